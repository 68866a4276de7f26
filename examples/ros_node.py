"""A node of ROS 2 that explores. It was not run on ROS itself: a test runs `Explorer` with messages of a stand-in."""

import threading
from collections.abc import Callable
from typing import Any

import chainslam
from chainslam import ros


class Explorer:
    """All of the node but ROS: messages come in at `robot`; twists, a map and the odometry's place in it go out."""

    def __init__(self, twist: Callable[..., None], grid: Callable[..., None], frame: Callable[..., None]) -> None:
        self.robot = ros.MessageRobot(twist, chainslam.RobotSpec(radius_m=0.2), sigma_m=0.01)
        self.grid, self.frame = grid, frame

    def run(self, **limits: Any) -> chainslam.Run:
        """Explore until nothing is left, or until `robot.cancel()`."""
        spec = self.robot.spec(body="base_link")
        return chainslam.explore(chainslam.SteppedRobot(self.robot), robot=spec, watch=self.publish, **limits)

    def publish(self, step: chainslam.Step) -> None:
        """Tell what one step has made of the map."""
        self.grid(ros.occupancy_grid(step.free_space))
        time_s = step.scan.time_s
        self.frame(ros.map_to_odom(step.pose_world, self.robot.pose_odom(time_s)), time_s)


if __name__ == "__main__":
    import rclpy
    from geometry_msgs.msg import TransformStamped, Twist
    from nav_msgs.msg import OccupancyGrid, Odometry
    from rclpy.qos import QoSProfile, qos_profile_sensor_data
    from sensor_msgs.msg import LaserScan
    from tf2_msgs.msg import TFMessage

    rclpy.init()
    node, latched = rclpy.create_node("chainslam"), QoSProfile(depth=1, durability=1)
    motors, maps = node.create_publisher(Twist, "cmd_vel", 1), node.create_publisher(OccupancyGrid, "map", latched)
    tf = node.create_publisher(TFMessage, "tf", 1)

    def frame(*told: Any) -> None:
        """Send where the odometry's frame lies in the map, and when that was."""
        tf.publish(TFMessage(transforms=[ros.written_transform(TransformStamped(), "map", "odom", *told)]))

    core = Explorer(
        lambda twist: motors.publish(ros.written_twist(Twist(), twist)),
        lambda grid: maps.publish(grid.written(OccupancyGrid())),
        frame,
    )
    node.create_subscription(LaserScan, "scan", core.robot.on_scan, qos_profile_sensor_data)
    node.create_subscription(Odometry, "odom", core.robot.on_odometry, qos_profile_sensor_data)
    node.create_subscription(TFMessage, "tf_static", core.robot.on_tf, latched)
    threading.Thread(target=lambda: print(core.run().summary["reason"])).start()
    node.context.on_shutdown(core.robot.cancel)
    rclpy.spin(node)
