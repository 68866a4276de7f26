"""What readers of recorded logs hand on: one scan after another, with the wheels' pose of the scanner."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import compose, inverse, wrap

SAME_M, SAME_RAD = 0.01, 0.01
"""A scanner that is fixed to the body is at one place of it, to within rounding."""
FARTHEST_M = 2.0
"""No scanner sits farther from the middle of its robot."""


class LogError(ValueError):
    """A log that cannot be read on, in words: the place, what was expected there, and what was found.

    Readers raise it where they cannot go on, and yield it in place of a scan that cannot be read.
    """


class ClockError(LogError):
    """Two kinds of messages of one log, told by clocks that have no time in common: nothing of it can be used."""


@dataclass
class LeftOut:
    """Scans of a log that are not read."""

    count: int = 0
    first: str = ""
    """Why the first of them was not, in words with the place."""

    def add(self, *why: str) -> None:
        """Count one more for each of the reasons."""
        self.count, self.first = self.count + len(why), self.first or "".join(why[:1])

    def words(self, read: int) -> str:
        """How many scans are left out beside those that were read, and why; nothing where none is."""
        return f"{self.count} of {read + self.count} scans are left out: {self.first}" if self.count else ""


@dataclass(frozen=True)
class RawScan:
    """One scan of k beams as a log has it."""

    time_s: float
    """By the log's own clock."""
    bearings_rad: Float[np.ndarray, " k"]
    ranges_m: Float[np.ndarray, " k"]
    """+inf where nothing came back, NaN where a beam tells nothing."""
    range_max_m: float
    robot_odom: Float[np.ndarray, "3"] | None
    """The robot by its wheels alone, m m rad; None where the log tells no motion."""
    scanner_odom: Float[np.ndarray, "3"] | None = None
    """The scanner, as far as the log tells it beside the robot; corrected logs tell another path here."""
    place: str = ""
    """Where in the file it stands."""


def as_returns(ranges_m: Float[np.ndarray, " k"], none_from_m: float) -> Float[np.ndarray, " k"]:
    """Return ranges with +inf where nothing came back (`none_from_m` and more), and NaN where a beam tells nothing."""
    far = np.where(ranges_m >= none_from_m, np.inf, ranges_m)
    return np.where(far > 0.0, far, np.nan)


def scanner_on_robot(scans: list[RawScan]) -> Float[np.ndarray, "3"]:
    """Return the scanner's pose on the robot, from scans of the first metres; zero where the log tells none.

    A log that was corrected tells the scanner's corrected pose: that one does not stay at one place of the robot.
    """
    told = [(s.robot_odom, s.scanner_odom) for s in scans if s.robot_odom is not None and s.scanner_odom is not None]
    if not told or len(told) < len(scans):
        return np.zeros(3)
    places = np.array([compose(inverse(robot), scanner) for robot, scanner in told])
    off = places - places[0]
    fixed = np.all(np.abs(off[:, :2]) < SAME_M) and np.all(np.abs(wrap(off[:, 2])) < SAME_RAD)
    return places[0] if fixed and np.hypot(*places[0, :2]) <= FARTHEST_M else np.zeros(3)
