"""Messages of ROS in and out, without ROS: what a node needs besides its subscriptions (docs/howto/ros.md)."""

from experiments.artifacts.maps.occupancy import OccupancyGrid, occupancy_grid
from slam.robot.ros.laser_scan import timed_scan
from slam.robot.ros.odometry_buffer import OdometryBuffer
from slam.robot.ros.robot import CancelledError, MessageRobot, map_to_odom
from slam.robot.ros.transforms import Frames
from slam.robot.ros.written import written_transform, written_twist

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
