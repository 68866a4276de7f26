"""A robot whose odometry is told by its scans, with its wheels for a first guess."""

from ..robot import MotionCommand, Odometry, Robot, Scan
from .scan_matching import ScanMatcher


class MatchedRobot:
    """Stands before any robot: it senses once more in time to say how far the last command went."""

    def __init__(self, robot: Robot, matcher: ScanMatcher) -> None:
        self._robot, self._matcher = robot, matcher
        self._scan: Scan | None = None

    def sense(self) -> Scan:
        """Return the scan at the present place, taken once."""
        if self._scan is None:
            self._scan = self._robot.sense()
            self._matcher.begin(self._scan)
        return self._scan

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command and return the motion as the scans tell it."""
        wheels = self._robot.drive(command)
        self._scan = self._robot.sense()
        return self._matcher.match(self._scan, wheels)
