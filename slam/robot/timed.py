"""What a robot that streams gives and takes: scans with the times of their beams, and velocities."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np
from jaxtyping import Float

from .messages import Odometry


@dataclass(frozen=True)
class TimedScan:
    """One turn of the range finder as its driver gives it: beams one after another, while the robot may move."""

    bearings_rad: Float[np.ndarray, " k"]
    """In the order in which the beams were taken, evenly spaced, ascending or descending."""
    ranges_m: Float[np.ndarray, " k"]
    """As in `Scan`: +inf where nothing came back, NaN where the beam tells nothing."""
    sigma_m: float
    range_max_m: float
    start_s: float
    """When the first beam was taken, on the robot's clock."""
    end_s: float
    """When the last one was."""
    range_min_m: float = 0.0
    """Returns below this tell nothing."""
    sigma_share: float = 0.0
    """As in `Scan`: standard deviation as a share of the range, beside `sigma_m`."""


@dataclass(frozen=True)
class Twist:
    """What the motors are to do until told otherwise."""

    speed_m_s: float
    turn_rad_s: float


@runtime_checkable
class StreamingRobot(Protocol):
    """A robot whose scans, odometry and motors go on by themselves."""

    def scan(self) -> TimedScan | None:
        """Wait for the next scan and return it; None where none has come within the driver's own patience.

        It is called on a thread of its own, so that a robot whose scanner has died can be stopped.
        """
        ...

    def odometry(self, from_s: float, to_s: float) -> Odometry:
        """Return the motion between two times, in the robot's frame at the first; called on the thread of `scan`.

        Wait until the second time is known, if it is not yet.
        """
        ...

    def send(self, twist: Twist) -> None:
        """Drive like this from now on."""
        ...

    def stop(self) -> None:
        """Stand still."""
        ...
