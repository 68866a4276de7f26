"""The robot as this software sees it: what it states of itself, and what passes between the two."""

from .errors import RobotError
from .messages import MotionCommand, Odometry, Robot, Scan
from .spec import NANO, STATED, LidarSpec, RobotSpec, ScannerSpec, fitted, of_outline, of_robot
from .wheels import WheelSpec

__all__ = [
    "NANO",
    "STATED",
    "LidarSpec",
    "MotionCommand",
    "Odometry",
    "Robot",
    "RobotError",
    "RobotSpec",
    "Scan",
    "ScannerSpec",
    "WheelSpec",
    "fitted",
    "of_outline",
    "of_robot",
]
