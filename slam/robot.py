"""The robot as this software sees it: all that passes between the two is in this file."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float


@dataclass(frozen=True)
class Scan:
    """One turn of the range finder, in the robot frame."""

    bearings_rad: Float[np.ndarray, " k"]
    """Strictly increasing, evenly spaced beam directions, counter-clockwise from straight ahead."""
    ranges_m: Float[np.ndarray, " k"]
    """Distance along each beam; NaN where nothing came back."""
    sigma_m: float
    """Standard deviation of the radial error of one beam."""
    range_max_m: float
    """Returns beyond this are rejected; a beam without a return is free up to here."""
    time_s: float

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
