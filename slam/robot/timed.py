"""The messages of a streaming robot: scans with the times of their beams, and velocities."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from .messages import Odometry


@dataclass(frozen=True)
class TimedScan:
    """One revolution of the range finder, as its driver reports it while the robot may move."""

    bearings_rad: Float[np.ndarray, " k"]
    """Evenly spaced, in the order of time, ascending or descending."""
    ranges_m: Float[np.ndarray, " k"]
    """As in `Scan`: +inf for no return, NaN for an invalid beam."""
    sigma_m: float
    range_max_m: float
    start_s: float
    """Time of the first beam, on the robot's clock."""
    end_s: float
    """Time of the last beam."""
    range_min_m: float = 0.0
    """Returns below this are invalid."""
    sigma_share: float = 0.0
    """As in `Scan`: additional standard deviation as a share of the range."""


@dataclass(frozen=True)
class Twist:
    """Velocity that the motors keep until the next command."""

    speed_m_s: float
    turn_rad_s: float


@runtime_checkable
class StreamingRobot(Protocol):
    """A robot that scans and moves continuously."""

    def scan(self) -> TimedScan | None:
        """Wait for the next scan and return it; None if none arrives within the driver's own timeout.

        It is called on a separate thread, so that a robot whose scanner has failed can still be stopped.
        """
        ...

    def odometry(self, from_s: float, to_s: float) -> Odometry:
        """Return the motion between two times, in the robot's frame at the first; called on the thread of `scan`.

        It waits for odometry up to the second time.
        """
        ...

    def send(self, twist: Twist) -> None:
        """Drive at this velocity from now on."""
        ...

    def stop(self) -> None:
        """Stand still."""
        ...
