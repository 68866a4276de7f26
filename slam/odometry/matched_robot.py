"""A robot whose odometry is told by its scans, with its wheels for a first guess."""

from dataclasses import replace

from ..estimation.mounting import odometry_of_body, odometry_of_scanner
from ..robot import MotionCommand, Odometry, Robot, Scan, ScannerSpec
from .scan_matching import ScanMatcher

AT_AXLE = ScannerSpec()
"""Where most scanners sit."""


class MatchedRobot:
    """Stands before any robot: it senses once more in time to say how far the last command went."""

    def __init__(self, robot: Robot, matcher: ScanMatcher, scanner: ScannerSpec = AT_AXLE) -> None:
        self._robot, self._matcher, self._scanner = robot, matcher, scanner
        self._scan: Scan | None = None

    def sense(self) -> Scan:
        """Return the scan at the present place, taken once."""
        if self._scan is None:
            self._scan = self._robot.sense()
            self._matcher.begin(self._scan)
        return self._scan

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command and return the motion of the body as the scans tell it."""
        wheels = self._robot.drive(command)
        self._scan = self._robot.sense()
        if wheels.carried:
            self._matcher.begin(self._scan)
            return wheels
        matched = self._matcher.match(self._scan, odometry_of_scanner(wheels, self._scanner))
        return replace(odometry_of_body(matched, self._scanner), wheels=wheels)
