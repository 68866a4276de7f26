"""A streaming robot made of messages that arrive by callbacks."""

from collections.abc import Callable
from dataclasses import replace
from threading import Condition
from typing import Any

import numpy as np
from jaxtyping import Float

from ...geometry.poses import compose, inverse
from ..errors import RobotError
from ..messages import Odometry
from ..spec import RobotSpec, ScannerSpec
from ..timed import TimedScan, Twist
from .laser_scan import is_covered, timed_scan
from .odometry_buffer import OdometryBuffer
from .transforms import Frames, planar, seconds

PLAIN = RobotSpec()


class CancelledError(KeyboardInterrupt):
    """A run was cancelled: it ends as by Ctrl-C, with what was mapped until then."""


class MessageRobot:
    """A `StreamingRobot` made of ROS messages; callbacks may come from any thread.

    Pass each message to `on_scan`, `on_odometry` or `on_wheels`, and `on_tf`, which may give the odometry, too.
    `publish` sends a twist to the motors. Messages are read by the names of their fields.
    """

    def __init__(
        self,
        publish: Callable[[Twist], None],
        spec: RobotSpec = PLAIN,
        sigma_m: float = 0.01,
        sigma_share: float = 0.0,
        wait_s: float = 2.0,
    ) -> None:
        self._publish, self._spec, self._wait_s = publish, spec, wait_s
        self._sigma_m, self._sigma_share = sigma_m, sigma_share
        self._arrived = Condition()
        self._scan: Any = None
        """The newest message that nobody has asked for yet."""
        self._frame = ""
        self._frames, self._odometry = Frames(), OdometryBuffer()
        self._has_odometry, self._is_cancelled = False, False
        self._ways_m: tuple[float, float] | None = None
        self._pose: Float[np.ndarray, 3] = np.zeros(3)
        self.covered = 0
        """Number of scans left out because the scanner was inside something."""

    def on_scan(self, message: Any) -> None:
        """Take in a LaserScan."""
        with self._arrived:
            self._frame = message.header.frame_id
            if is_covered(message):
                self.covered += 1
                return
            self._scan = message
            self._arrived.notify_all()

    def on_odometry(self, message: Any) -> None:
        """Take in an Odometry message; its pose and time are used, its covariance is not."""
        with self._arrived:
            self._has_odometry = True
            self._frames.body = message.child_frame_id
            self._odometry.add(seconds(message.header.stamp), planar(message.pose.pose.position, message.pose.pose))
            self._arrived.notify_all()

    def on_wheels(self, time_s: float, left_m: float, right_m: float) -> None:
        """Take in the distances that both wheels have travelled since the beginning, m."""
        with self._arrived:
            before, self._ways_m = self._ways_m or (left_m, right_m), (left_m, right_m)
            motion = self._spec.wheels.odometry(left_m - before[0], right_m - before[1]).motion
            self._pose = compose(self._pose, motion)
            self._has_odometry = True
            self._odometry.add(time_s, self._pose)
            self._arrived.notify_all()

    def on_tf(self, message: Any) -> None:
        """Take in a TFMessage of /tf or /tf_static; it gives the odometry if no other message does."""
        with self._arrived:
            for time_s, pose in self._frames.take(message):
                if not self._has_odometry:
                    self._odometry.add(time_s, pose)
            self._arrived.notify_all()

    def cancel(self) -> None:
        """Stop the robot and end the run; what was mapped until then is kept."""
        with self._arrived:
            self._is_cancelled = True
            self._arrived.notify_all()
        self.stop()

    def spec(self, body: str = "", wait_s: float = 5.0) -> RobotSpec:
        """Return the robot's description with the scanner's pose from tf; `body` is its frame if no message names it.

        Raises RobotError if no transform arrives in time.
        """
        with self._arrived:
            self._frames.body = self._frames.body or body
            if not self._wait(lambda: bool(self._frame) and self._frames.tells(self._frame), wait_s):
                raise RobotError(
                    f"expected a transform from {self._frames.body or 'the body'} to {self._frame or 'the scanner'},"
                    f" found none in {wait_s:g} s: publish it, or state the scanner's place in the RobotSpec"
                )
            x, y, heading = self._frames.on_body(self._frame)[0].tolist()
        return replace(self._spec, scanner=ScannerSpec(x, y, heading))

    def scan(self) -> TimedScan | None:
        """Wait for the next scan and return it; None if none arrives in `wait_s`. Older ones are left out."""
        with self._arrived:
            if not self._wait(lambda: self._scan is not None, self._wait_s):
                return None
            message, self._scan = self._scan, None
            is_turned = self._frames.on_body(self._frame)[1]
        return timed_scan(message, is_turned, self._sigma_m, self._sigma_share)

    def odometry(self, from_s: float, to_s: float) -> Odometry:
        """Return the motion between two times, with the covariance of the wheels' stated slip.

        It waits for odometry up to the second time; raises TimeoutError after `wait_s`.
        """
        with self._arrived:
            if not self._wait(lambda: self._odometry.newest_s >= to_s, self._wait_s):
                raise TimeoutError(f"no odometry up to {to_s:.3f} s")
            poses = self._odometry.poses(from_s, to_s)
        return self._spec.wheels.along(poses)

    def pose_odom(self, time_s: float) -> Float[np.ndarray, "3"]:
        """Return the body's pose at a time in the frame of its odometry."""
        with self._arrived:
            return self._odometry.pose(time_s)

    def send(self, twist: Twist) -> None:
        """Drive at this velocity from now on."""
        if not self._is_cancelled:
            self._publish(twist)

    def stop(self) -> None:
        """Stand still."""
        self._publish(Twist(0.0, 0.0))

    def _wait(self, has_come: Callable[[], bool], wait_s: float) -> bool:
        """Wait for something that arrives; raises CancelledError."""
        found = self._arrived.wait_for(lambda: self._is_cancelled or has_come(), wait_s)
        if self._is_cancelled:
            raise CancelledError("a cancel")
        return found


def map_to_odom(pose_map: Float[np.ndarray, "3"], pose_odom: Float[np.ndarray, "3"]) -> Float[np.ndarray, "3"]:
    """Return the transform from map to odom (REP 105), from the body's poses in both frames at the same time."""
    return compose(pose_map, inverse(pose_odom))
