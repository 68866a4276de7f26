"""How far one command has come: what the odometry says of it, what was sent, and what would be too far."""

import numpy as np
from jaxtyping import Float

from .errors import RobotError
from .messages import MotionCommand, Odometry
from .timed import Twist

OVER = 1.3
"""More than this share of a command is too far."""
SLACK_M, SLACK_RAD = 0.02, 0.05
"""So much beyond a short command is not: wheels and slow drivers are off by it."""
ASIDE_M_RAD, ASIDE_RAD_M = 0.3, 1.0
"""A turn may move the place that odometry tells of by so much, and a straight way may turn by so much."""
SENT_MOST = 1.12
"""No more than this share of a command is sent, whatever the odometry says: it may have died."""
FLOOR = 0.2
"""Motors turn at this share of their speed, or stand: the end of a command is no slower."""
LEAST = 0.01
"""A smaller share of a command is nothing."""
SLOW_S, SLOW_PERIODS = 0.3, 1.5
"""What is left of a command takes as long at least, in seconds and in periods of the scanner: so a robot that goes on
after a stop, obeys late or goes faster than it is told comes to its end slowly."""

TAUGHT, MOST_GAIN = 0.2, 2.0
"""From this share of a command on it shows how far the robot goes when told, up to so many times as far."""
HALF = 0.5
"""The first command is driven so far, and then to its end."""

Gains = dict[bool, float]
"""How many times as far as it was told a robot goes, for commands that are turns and for those that are not."""


class Errand:
    """One command on its way. A share of 1 is all of it; a wide turn and a long way count by the time they take."""

    def __init__(self, command: MotionCommand, speed_m_s: float, turn_rad_s: float, gains: Gains) -> None:
        self.command = command
        self._times = np.array([command.forward_m / speed_m_s, command.turn_rad / turn_rad_s])
        self._units = np.array([speed_m_s, turn_rad_s])
        self.seconds = float(np.abs(self._times).max())
        """At full speed."""
        self.done, self.sent = 0.0, 0.0
        """What the odometry says, and what was sent, as shares of the command."""
        self.is_touched = False
        """Whether a bumper has ended it."""
        self._gains, self._aim = gains, 1.0
        self._ahead = 0.0
        """What should be done by now, had the robot obeyed since it stood last."""

    @property
    def left(self) -> float:
        """What is still to do, by what the odometry says or by what was sent, whichever leaves less."""
        if self.is_touched:
            return 0.0
        return min(self._aim - max(self.done, self._ahead), SENT_MOST - self.sent)

    @property
    def is_turn(self) -> bool:
        """Whether its turn takes longer than its way."""
        return bool(abs(self._times[1]) > abs(self._times[0]))

    @property
    def gain(self) -> float:
        """How many times as far as it was told the robot goes, as far as is known."""
        return self._gains.get(self.is_turn, 1.0)

    def begin(self) -> None:
        """Go on from where the robot stands; half the way only, where nobody knows yet how far it goes when told."""
        if min(self.sent, self.done) >= TAUGHT:
            self._gains[self.is_turn] = min(max(self.done / self.sent, 1.0), MOST_GAIN)
        self._ahead = self.done
        self._aim = HALF if self.sent == 0.0 and self.is_turn not in self._gains else 1.0

    def rate(self, period_s: float) -> float:
        """Return which share a second to drive at next; 0 where nothing is left."""
        if self.left < LEAST:
            return 0.0
        fastest = 1.0 / self.seconds
        left = self.left / self.gain
        return min(fastest, max(left / max(SLOW_PERIODS * period_s, SLOW_S), min(FLOOR * fastest, left / period_s)))

    def twist(self, rate: float) -> Twist:
        """Return the command's arc at so many shares a second."""
        return Twist(rate * self.command.forward_m, rate * self.command.turn_rad)

    def add(self, share: float, odometry: Odometry) -> None:
        """Take in what was sent since, and the whole motion so far; raises RobotError where that is too far."""
        motion = odometry.motion
        self.sent += share
        self._ahead += share * self.gain
        self.is_touched = self.is_touched or odometry.touched
        along = np.array([np.hypot(motion[0], motion[1]) * (1.0 if motion[0] >= 0.0 else -1.0), motion[2]])
        self._check(along)
        if self.seconds > 0.0:
            self.done = float(self._times @ (along / self._units) / (self._times @ self._times))

    def _check(self, along: Float[np.ndarray, "2"]) -> None:
        """Raise RobotError where the robot went too far, or the other way."""
        told = np.array([self.command.forward_m, self.command.turn_rad])
        aside = np.array([ASIDE_M_RAD, ASIDE_RAD_M]) * np.abs(told[::-1])
        beyond = np.maximum((OVER - 1.0) * np.abs(told), np.array([SLACK_M, SLACK_RAD]) + aside)
        went = along * np.where(told < 0.0, -1.0, 1.0)
        if np.all((went <= np.abs(told) + beyond) & (went >= -beyond)):
            return
        raise RobotError(
            f"expected a drive of {told[0]:.3f} m and {np.rad2deg(told[1]):.1f} degrees, found {along[0]:.3f} m and"
            f" {np.rad2deg(along[1]):.1f} degrees, and stopped the robot: check its motors, its odometry and its speed"
        )
