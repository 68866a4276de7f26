"""The robot as this software sees it: all that passes between the two is in this file."""

from dataclasses import dataclass, field, fields, is_dataclass, replace
from functools import cached_property
from typing import Any, Protocol, TypeVar, runtime_checkable

import numpy as np
from jaxtyping import Float

NANO = 9
"""Sums of what a robot states are rounded to so many digits after the point: 0.2 m and 0.1 m are 0.3 m."""
TURN_OF_WAY = float(np.deg2rad(10.0)) / 0.15
"""A way among walls turns by so much at most, rad/m: robots of slow turns need more steps for it."""


@dataclass(frozen=True)
class Scan:
    """One turn of the range finder, in its own frame: where it sits on the body says `RobotSpec`."""

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


class RobotError(ValueError):
    """A robot that cannot be, told in one line: what was expected, what was found, what to do."""


@dataclass(frozen=True)
class ScannerSpec:
    """Where the range finder sits, in the robot frame: the origin is the middle of the axle, x points ahead."""

    x_m: float = 0.0
    """Ahead of the axle."""
    y_m: float = 0.0
    """To the left."""
    heading_rad: float = 0.0
    """Where its bearing zero points, counter-clockwise from straight ahead."""

    @property
    def is_at_axle(self) -> bool:
        """Whether it sees from the middle of the body."""
        return self.x_m == self.y_m == self.heading_rad == 0.0

    @property
    def pose_robot(self) -> Float[np.ndarray, "3"]:
        """X m, y m, heading rad."""
        return np.array([self.x_m, self.y_m, self.heading_rad])

    @property
    def off_m(self) -> float:
        """How far it sits from the middle of the axle."""
        return float(np.hypot(self.x_m, self.y_m))


@dataclass(frozen=True)
class WheelSpec:
    """Two driven wheels and how far they slip; the defaults lose 4 degrees of heading per square root of a metre."""

    base_m: float = 0.4
    """Distance m between the wheels."""
    slip: float = 0.02
    """Standard deviation m of a wheel's slip after one metre of its way; it grows with the square root."""
    lateral_slip: float = 0.006
    """Standard deviation m of the sideways slip after one metre of the wheels' mean way; likewise."""
    floor: float = 1e-6
    """Standard deviation m and rad added to the stated covariance, so that it is positive definite for a rest too."""


@dataclass(frozen=True)
class RobotSpec:
    """What a robot states of itself: planners, mapper, certificate and scores take it from here and nowhere else."""

    radius_m: float = 0.2
    """Radius of the body, a disc about the middle of the axle; of an outline, its farthest point (`of_outline`)."""
    step_m: float = 0.15
    """Longest step; longer commands are shortened along the same arc."""
    turn_rad: float = float(np.deg2rad(10.0))
    """Widest turn of one step; wider commands are shortened along the same arc."""
    can_reverse: bool = True
    """Whether it can drive backwards."""
    scanner: ScannerSpec = field(default_factory=ScannerSpec)
    wheels: WheelSpec = field(default_factory=WheelSpec)

    def __post_init__(self) -> None:
        """Raise RobotError for a body, a step or wheels that cannot be."""
        wheels, numbers = self.wheels, (self.scanner.x_m, self.scanner.y_m, self.scanner.heading_rad)
        above = {"radius_m": self.radius_m, "step_m": self.step_m, "turn_rad": self.turn_rad, "base_m": wheels.base_m}
        for name, value in above.items():
            if not 0.0 < value < np.inf:
                raise RobotError(f"expected a robot's {name} above 0 and finite, found {value:g}: correct it")
        for name, value in {"slip": wheels.slip, "lateral_slip": wheels.lateral_slip, "floor": wheels.floor}.items():
            if not 0.0 <= value < np.inf:
                raise RobotError(f"expected wheels with a {name} of 0 or more, found {value:g}: correct it")
        if not all(np.isfinite(numbers)):
            raise RobotError(f"expected a scanner at a finite place on the body, found {numbers}: correct it")

    def beyond(self, metres: float) -> float:
        """Return the distance from the middle of the body to so far beyond its rim, m."""
        return round(self.radius_m + metres, NANO)

    def steps_of(self, way_m: float) -> int:
        """Return how many steps a way takes at most, if it turns no more than ways among walls do."""
        return round(max(way_m / self.step_m, way_m * TURN_OF_WAY / self.turn_rad))


def of_outline(points_m: Float[np.ndarray, "n 2"]) -> float:
    """Return the radius of the disc about the middle of the axle that holds an outline, m, robot frame."""
    return float(np.hypot(points_m[:, 0], points_m[:, 1]).max())


def of_robot() -> Any:
    """Return a field of a group of settings that holds what the robot states: no setting of its own (`fitted`)."""
    return field(default=RobotSpec(), repr=False, metadata={STATED: True})


STATED = "stated by the robot"
"""Marks such a field."""

Settings = TypeVar("Settings")


def fitted(settings: Settings, robot: RobotSpec) -> Settings:
    """Return a group of settings, and all groups within, for a robot."""
    assert is_dataclass(settings)
    assert not isinstance(settings, type)
    changes: dict[str, Any] = {}
    for each in fields(settings):
        value = getattr(settings, each.name)
        if each.metadata.get(STATED):
            changes[each.name] = robot
        elif is_dataclass(value) and not isinstance(value, type):
            changes[each.name] = fitted(value, robot)
    return replace(settings, **changes)


@runtime_checkable
class Robot(Protocol):
    """Anything that senses and drives: the simulated robot, a recorded one, or real hardware."""

    def sense(self) -> Scan:
        """Return the scan at the present place."""
        ...

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command and return the odometry."""
        ...
