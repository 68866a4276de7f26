"""What the body touched, kept in the robot's frame by what the odometry reports: an obstacle, whatever scans show."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import to_robot
from chainslam.slam.robot import MotionCommand, Odometry, RobotSpec
from chainslam.slam.robot.body import ahead_m, reaches_m

REACH_M = 0.04
"""A return this near to the body, on the side to which it moved, may be what it met."""
KEPT_M = 1.0
"""What is farther off matters to no step from here."""
BESIDE_SHARE = 0.25
"""A return up to 15 degrees behind the body's side counts as being on the side to which it moved."""

UNSURE_M = 0.03
"""A disc that met something 30 degrees off its front has this between its front and what it met."""


class Touches:
    """Places that the body met."""

    def __init__(self, robot: RobotSpec) -> None:
        """Remember what the body of a robot meets."""
        self._robot = robot
        self._points: Float[np.ndarray, "n 2"] = np.zeros((0, 2))
        self._ahead = np.array([1.0, 0.0])
        self.is_new = False
        """Whether the last step touched something that was not located yet."""

    @property
    def points_robot(self) -> Float[np.ndarray, "n 2"]:
        """All that is remembered, m, in the robot's frame of now."""
        return self._points

    def move(self, odometry: Odometry, command: MotionCommand) -> None:
        """Take note of one step: where the robot went, and whether it touched something."""
        points = to_robot(self._points, odometry.motion)
        self._points = points[np.hypot(points[:, 0], points[:, 1]) < KEPT_M]
        self.is_new = odometry.touched
        self._ahead = np.array([-1.0 if command.forward_m < 0.0 else 1.0, 0.0])

    def meet(self, near_robot: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, "t 2"]:
        """Return where the body may have met something, given what the last scans hit, m, robot frame; remember it.

        That is its front, whatever the scans show, so far within the body as nobody knows where on it that was, and the
        nearest return on that side.
        """
        gap, reach = np.hypot(near_robot[:, 0], near_robot[:, 1]), reaches_m(near_robot, self._robot)
        met = [(ahead_m(self._robot, float(self._ahead[0])) - UNSURE_M) * self._ahead]
        on_side = (near_robot @ self._ahead > -BESIDE_SHARE * gap) & (reach < self._robot.radius_m + REACH_M)
        if on_side.any():
            row = int(np.argmin(reach[on_side]))
            nearest, away_m = near_robot[on_side][row], reach[on_side][row] - self._robot.radius_m
            rim_m = self._robot.radius_m if self._robot.outline_m is None else gap[on_side][row] - away_m
            met.append(rim_m * nearest / max(float(np.hypot(*nearest)), 1e-9))
        self._points = np.vstack([self._points, *met])
        self.is_new = False
        return np.array(met)
