"""Frames on frames, as tf tells them: where a scanner sits on the body."""

import math
from typing import Any

import numpy as np
from jaxtyping import Float

from ...geometry.poses import compose
from ..errors import RobotError


def seconds(stamp: Any) -> float:
    """Return a time; ROS 1 says `secs` and `nsecs` where ROS 2 and bags say `sec` and `nanosec`."""
    if hasattr(stamp, "secs"):
        return float(stamp.secs) + 1e-9 * float(stamp.nsecs)
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def planar(place: Any, pose: Any) -> Float[np.ndarray, "3"]:
    """Return place and heading in the plane: where a frame's ahead points, seen from above. Raises RobotError."""
    q = _rotation_of(pose)
    heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    found = np.array([place.x, place.y, heading], dtype=np.float64)
    if not np.all(np.isfinite(found)):
        raise RobotError("expected a finite pose, found NaN or infinity: correct what publishes it")
    return found


def is_upside_down(pose: Any) -> bool:
    """Return whether a frame's up points down in the frame that it sits on."""
    q = _rotation_of(pose)
    return bool(2.0 * float(q.x * q.x + q.y * q.y) > 1.0)


def _rotation_of(pose: Any) -> Any:
    return pose.orientation if hasattr(pose, "orientation") else pose.rotation


class Frames:
    """Where frames sit on each other, as far as it does not change."""

    def __init__(self) -> None:
        self.body = ""
        """The frame of the body: that of the odometry's child."""
        self._on: dict[str, tuple[str, np.ndarray, bool]] = {}
        """For each frame its parent, its pose there, and whether it lies upside down."""

    def take(self, message: Any) -> list[tuple[float, Float[np.ndarray, "3"]]]:
        """Take in a tf message; return the times and poses of the body that it tells in an odom frame."""
        told = []
        for transform in message.transforms:
            parent, child = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
            pose = planar(transform.transform.translation, transform.transform)
            if "odom" in parent:
                told.append((seconds(transform.header.stamp), pose))
                self.body = self.body or child
            elif "map" not in parent:
                self._on[child] = (parent, pose, is_upside_down(transform.transform))
        return told

    def tells(self, frame: str) -> bool:
        """Whether transforms lead from a frame to the body."""
        frame = frame.strip("/")
        for _ in range(len(self._on) + 1):
            if frame == self.body.strip("/"):
                return True
            if frame not in self._on:
                return False
            frame = self._on[frame][0]
        return False

    def on_body(self, frame: str) -> tuple[Float[np.ndarray, "3"], bool]:
        """Return a frame's pose on the robot's body, and whether it lies upside down; zero where nothing tells it."""
        pose, is_turned = np.zeros(3), False
        frame, body = frame.strip("/"), self.body.strip("/")
        for _ in range(len(self._on) + 1):
            if frame == body or frame not in self._on:
                break
            frame, on_parent, over = self._on[frame]
            if over:
                pose = pose * np.array([1.0, -1.0, -1.0])
            pose, is_turned = compose(on_parent, pose), is_turned != over
        return pose, is_turned
