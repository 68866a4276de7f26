"""Outgoing messages: each is passed empty, as ROS makes it, and its fields are filled."""

from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float

from ..timed import Twist

Message = TypeVar("Message")


def written_twist(message: Message, twist: Twist) -> Message:
    """Fill and return an empty `geometry_msgs/Twist`."""
    filled: Any = message
    filled.linear.x, filled.angular.z = float(twist.speed_m_s), float(twist.turn_rad_s)
    return message


def written_transform(
    message: Message, parent: str, child: str, pose: Float[np.ndarray, "3"], time_s: float
) -> Message:
    """Fill and return an empty `geometry_msgs/TransformStamped` with a child's pose (x m, y m, heading rad)."""
    filled: Any = message
    filled.header.frame_id, filled.child_frame_id = parent, child
    write_stamp(filled.header.stamp, time_s)
    filled.transform.translation.x, filled.transform.translation.y = float(pose[0]), float(pose[1])
    filled.transform.rotation.z, filled.transform.rotation.w = float(np.sin(pose[2] / 2)), float(np.cos(pose[2] / 2))
    return message


def write_stamp(stamp: Any, time_s: float) -> None:
    """Write a time, as ROS 1 or ROS 2 names its parts."""
    whole = int(time_s)
    names = ("secs", "nsecs") if hasattr(stamp, "secs") else ("sec", "nanosec")
    for name, value in zip(names, (whole, int(1e9 * (time_s - whole))), strict=True):
        setattr(stamp, name, value)
