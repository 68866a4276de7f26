"""Conversion from and to ROS messages without ROS: what a node needs besides its subscriptions (docs/howto/ros.md)."""

from chainslam.experiments.artifacts.maps.occupancy import OccupancyGrid, occupancy_grid
from chainslam.slam.robot.ros.laser_scan import timed_scan
from chainslam.slam.robot.ros.odometry_buffer import OdometryBuffer
from chainslam.slam.robot.ros.robot import CancelledError, MessageRobot, map_to_odom
from chainslam.slam.robot.ros.transforms import Frames
from chainslam.slam.robot.ros.written import written_transform, written_twist

__all__ = [
    "CancelledError",
    "Frames",
    "MessageRobot",
    "OccupancyGrid",
    "OdometryBuffer",
    "map_to_odom",
    "occupancy_grid",
    "timed_scan",
    "written_transform",
    "written_twist",
]
