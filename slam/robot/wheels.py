"""Two driven wheels, and what they tell of a motion."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from ..geometry.poses import arc, compose, inverse, rotation
from ..geometry.quantities import Body, Slip
from .messages import Odometry


@dataclass(frozen=True)
class WheelSpec:
    """Two driven wheels and their slip; by default the heading drifts by 4 degrees per square root of a metre."""

    base_m: Body = 0.4
    """Distance between the two wheels."""
    slip: Slip = 0.02
    """Standard deviation of a wheel's slip after 1 m; it grows with the square root of the distance."""
    lateral_slip: Slip = 0.006
    """Standard deviation of the sideways slip after 1 m; it grows with the square root of the wheels' mean distance."""
    floor: Slip = 1e-6
    """Standard deviation (m and rad) added to the odometry's covariance, so that it is positive definite even at
    rest."""

    def ways(self, forward_m: float, turn_rad: float) -> tuple[float, float]:
        """Return the ways m of the left and the right wheel over an arc."""
        half = 0.5 * self.base_m * turn_rad
        return forward_m - half, forward_m + half

    def slip_variances(self, forward_m: float, turn_rad: float) -> Float[np.ndarray, "3"]:
        """Return the variances m^2 of the left, right and lateral slip over an arc."""
        left, right = self.ways(forward_m, turn_rad)
        left, right = abs(left), abs(right)
        return np.array([self.slip**2 * left, self.slip**2 * right, self.lateral_slip**2 * 0.5 * (left + right)])

    def over_arc(self, forward_m: float, turn_rad: float) -> Odometry:
        """Return the motion over an arc with its first-order covariance, in the robot frame before it."""
        half = 0.5 * turn_rad
        along, across = np.array([np.cos(half), np.sin(half)]), np.array([-np.sin(half), np.cos(half)])
        sinc = np.sinc(half / np.pi)
        # d sinc(h)/dh = (cos h - sinc h)/h loses its digits near zero, where -h/3 is exact to h^3/30.
        slope = (np.cos(half) - sinc) / half if abs(half) > 1e-3 else -half / 3.0
        by_forward = sinc * along
        by_turn = 0.5 * forward_m * (slope * along + sinc * across)
        to_arc = np.array([[0.5, 0.5, 0.0], [-1.0 / self.base_m, 1.0 / self.base_m, 0.0], [0.0, 0.0, 1.0]])
        by_slip = np.zeros((3, 3))
        by_slip[:2] = np.stack([by_forward, by_turn, across], axis=-1) @ to_arc
        by_slip[2] = to_arc[1]
        cov = (by_slip * self.slip_variances(forward_m, turn_rad)) @ by_slip.T + self.floor**2 * np.eye(3)
        return Odometry(arc(forward_m, turn_rad), 0.5 * (cov + cov.T))

    def odometry(self, left_m: float, right_m: float) -> Odometry:
        """Return the motion by two encoders, from the distances of the left and the right wheel since the last one, m.

        It is one arc; `along` combines many of them into a longer drive.
        """
        return self.over_arc(0.5 * (left_m + right_m), (right_m - left_m) / self.base_m)

    def along(self, poses: Float[np.ndarray, "n 3"]) -> Odometry:
        """Return the motion from the first pose to the last, with the covariance of the path along all of them.

        Each motion from one pose to the next counts as an arc.
        """
        motion, cov = np.zeros(3), np.zeros((3, 3))
        for before, after in pairwise(poses):
            step = compose(inverse(before), after)
            ahead = float(np.copysign(np.hypot(step[0], step[1]), step[0]))
            R = np.eye(3)
            R[:2, :2] = rotation(motion[2])
            by_heading = np.eye(3)
            by_heading[:2, 2] = R[:2, :2] @ np.array([-step[1], step[0]])
            cov = by_heading @ cov @ by_heading.T + R @ self.over_arc(ahead, float(step[2])).cov @ R.T
            motion = compose(motion, step)
        return Odometry(motion, 0.5 * (cov + cov.T) + self.floor**2 * np.eye(3))
