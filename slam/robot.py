"""The robot as this software sees it: all that passes between the two is in this file."""

from dataclasses import dataclass
from functools import cached_property
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Scan:
    """One turn of the range finder, in the robot frame."""

    bearings_rad: Float[np.ndarray, " k"]
    """Strictly increasing, evenly spaced beam directions, counter-clockwise from straight ahead."""
    ranges_m: Float[np.ndarray, " k"]
    """Distance along each beam. As ROS drivers say it (REP 117): +inf where nothing came back, NaN where the beam tells
    nothing, as below the scanner's minimum range."""
    sigma_m: float | Float[np.ndarray, " k"]
    """Standard deviation of the radial error, one for all beams or one for each."""
    range_max_m: float
    """Returns beyond this are rejected; a beam without a return is free up to here."""
    time_s: float
    """When the scan was complete."""
    sigma_share: float = 0.0
    """Standard deviation as a share of the range, beside `sigma_m`; both add by squares."""

    @cached_property
    def passed_m(self) -> Float[np.ndarray, " k"]:
        """How far each beam surely went on, m: to its return, or to the maximum range; 0 where it tells nothing.

        Scanners lose single returns. So a beam without one went on only where both its neighbours have none either.
        """
        before, after = self._beside
        sure = np.isposinf(self.ranges_m) & np.isposinf(before) & np.isposinf(after)
        return np.where(np.isfinite(self.ranges_m), self.ranges_m, np.where(sure, self.range_max_m, 0.0))

    @cached_property
    def shown_m(self) -> Float[np.ndarray, " k"]:
        """How far each beam shows free floor, m; where a return is missing alone, the nearer of its neighbours' says.

        0 where beams tell nothing.
        """
        before, after = self._beside
        lone = ~np.isfinite(self.ranges_m) & np.isfinite(np.maximum(before, after))
        free = np.where(np.isposinf(self.ranges_m), self.range_max_m, self.ranges_m)
        shown = np.where(lone, np.minimum(before, after), free)
        return np.where(np.isnan(shown), 0.0, shown)

    @cached_property
    def _beside(self) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"]]:
        """Return the ranges of the beams before and after each; +inf beyond the ends of less than a full turn."""
        first, last = (self.ranges_m[0], self.ranges_m[-1]) if self.is_full_turn else (np.inf, np.inf)
        around = np.concatenate([[last], self.ranges_m, [first]])
        return around[:-2], around[2:]

    @property
    def sigmas_m(self) -> Float[np.ndarray, " k"]:
        """The standard deviation of each beam's radial error, m; at its measured range, where noise grows with it."""
        sigmas = np.broadcast_to(np.asarray(self.sigma_m, dtype=np.float64), self.ranges_m.shape)
        if self.sigma_share <= 0.0:
            return sigmas
        return np.hypot(sigmas, self.sigma_share * np.where(np.isfinite(self.ranges_m), self.ranges_m, 0.0))

    @property
    def is_full_turn(self) -> bool:
        """Whether the first beam follows the last one (a 360 degree scanner)."""
        step = (self.bearings_rad[-1] - self.bearings_rad[0]) / (len(self.bearings_rad) - 1)
        return bool(len(self.bearings_rad) * step > 2 * np.pi - 0.5 * step)


@dataclass(frozen=True)
class Odometry:
    """Motion since the last step as the robot measured it, in the robot frame before the motion."""

    motion: Float[np.ndarray, "3"]
    """x m, y m, heading rad."""
    cov: Float[np.ndarray, "3 3"]
    """Covariance of the motion's error, in the same frame."""
    touched: bool = False
    """A bumper says that the body met something on the way; a robot without one never says so."""


@dataclass(frozen=True)
class MotionCommand:
    """One step of driving: an arc of constant curvature."""

    forward_m: float
    turn_rad: float


@runtime_checkable
class Robot(Protocol):
    """Anything that senses and drives: the simulated robot, a recorded one, or real hardware."""

    def sense(self) -> Scan:
        """Return the scan at the present place."""
        ...

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command and return the odometry."""
        ...
