"""The output of readers of recorded logs: one scan after another, each with the odometry."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import compose, inverse, wrap

SAME_M, SAME_RAD = 0.01, 0.01
"""A scanner that is fixed to the body stays at one place on it, up to rounding."""
FARTHEST_M = 2.0
"""No scanner is farther from the middle of its robot."""


class LogError(ValueError):
    """A log that cannot be read further: the position, what was expected there, and what was found.

    Readers raise it if they cannot continue, and yield it for a scan that cannot be read.
    """


class ClockError(LogError):
    """Scans and odometry of one log on clocks without any time in common: nothing of it can be used."""


@dataclass
class LeftOut:
    """Scans of a log that are not read."""

    count: int = 0
    first: str = ""
    """Why the first of them was left out, in words with its position."""

    def add(self, *why: str) -> None:
        """Count one more of a reason."""
        self.count, self.first = self.count + len(why), self.first or "".join(why[:1])

    def words(self, read: int) -> str:
        """Return how many scans are left out and why; empty if there are none."""
        return f"{self.count} of {read + self.count} scans are left out: {self.first}" if self.count else ""


@dataclass(frozen=True)
class RawScan:
    """One scan of k beams, as in the log."""

    time_s: float
    """On the log's own clock."""
    bearings_rad: Float[np.ndarray, " k"]
    ranges_m: Float[np.ndarray, " k"]
    """+inf without a return, NaN for an invalid beam."""
    range_max_m: float
    robot_odom: Float[np.ndarray, "3"] | None
    """Pose of the robot by odometry alone, m m rad; None if the log has none."""
    scanner_odom: Float[np.ndarray, "3"] | None = None
    """Pose of the scanner, if the log contains it next to the robot's; corrected logs contain another path here."""
    place: str = ""
    """Position in the file."""


def as_returns(ranges_m: Float[np.ndarray, " k"], none_from_m: float) -> Float[np.ndarray, " k"]:
    """Return ranges with +inf for `none_from_m` and more, and NaN for invalid beams."""
    far = np.where(ranges_m >= none_from_m, np.inf, ranges_m)
    return np.where(far > 0.0, far, np.nan)


def scanner_on_robot(scans: list[RawScan]) -> Float[np.ndarray, "3"]:
    """Return the scanner's pose on the robot, from scans of the first metres; zero if the log does not contain it.

    A corrected log contains the scanner's corrected pose, which does not stay at one place on the robot.
    """
    told = [(s.robot_odom, s.scanner_odom) for s in scans if s.robot_odom is not None and s.scanner_odom is not None]
    if not told or len(told) < len(scans):
        return np.zeros(3)
    places = np.array([compose(inverse(robot), scanner) for robot, scanner in told])
    off = places - places[0]
    fixed = np.all(np.abs(off[:, :2]) < SAME_M) and np.all(np.abs(wrap(off[:, 2])) < SAME_RAD)
    return places[0] if fixed and np.hypot(*places[0, :2]) <= FARTHEST_M else np.zeros(3)
