"""What a robot states of itself, once, and how it reaches every setting that follows from it."""

from dataclasses import dataclass, field, fields, is_dataclass, replace
from typing import Any, TypeVar

import numpy as np
from jaxtyping import Float

from ..geometry.quantities import Body, Heading, Offset, Turn, fault
from .errors import RobotError
from .wheels import WheelSpec

NANO = 9
"""Sums of what a robot states are rounded to so many digits after the point: 0.2 m and 0.1 m are 0.3 m."""
TURN_OF_WAY = float(np.deg2rad(10.0)) / 0.15
"""A way among walls turns by so much at most, rad/m: robots of slow turns need more steps for it."""


@dataclass(frozen=True)
class ScannerSpec:
    """Where the range finder is mounted: origin in the middle of the axle, x ahead, y to the left."""

    x_m: Offset = 0.0
    """Position of the scanner ahead of the axle."""
    y_m: Offset = 0.0
    """Position of the scanner to the left of the axle's middle."""
    heading_rad: Heading = 0.0
    """Direction of the scanner's zero bearing, counter-clockwise from straight ahead."""

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
class LidarSpec:
    """What is asked of the ranges that its scanner measures."""

    calibrate: bool = field(default=False, kw_only=True)
    """Correct the ranges by the bias and the scale that the mapper estimates; otherwise both are only reported."""


@dataclass(frozen=True)
class RobotSpec:
    """Description of a robot, which planners, mapper and scores share."""

    radius_m: Body = 0.2
    """Radius of the body, a disc around the middle of the axle; with an outline, its farthest corner gives the radius
    instead."""
    outline_m: tuple[tuple[Offset, Offset], ...] | None = field(default=None, kw_only=True)
    """Corners, in order, of a convex body around the middle of the axle; without them the body is a disc."""
    step_m: Body = 0.15
    """Longest distance driven in one step; longer commands are shortened along the same arc."""
    turn_rad: Turn = float(np.deg2rad(10.0))
    """Largest turn in one step; larger commands are shortened along the same arc."""
    can_reverse: bool = True
    """Whether the robot can drive backwards."""
    scanner: ScannerSpec = field(default_factory=ScannerSpec)
    wheels: WheelSpec = field(default_factory=WheelSpec)
    lidar: LidarSpec = field(default_factory=LidarSpec)

    def __post_init__(self) -> None:
        """Raise RobotError for a body, a step, a scanner or wheels that cannot be."""
        if self.outline_m is not None:
            object.__setattr__(self, "outline_m", _convex(self.outline_m))
            object.__setattr__(self, "radius_m", of_outline(np.array(self.outline_m)))
        if wrong := fault(self):
            raise RobotError(f"expected a description of a robot, found {wrong}: correct it")

    @property
    def half_width_m(self) -> float:
        """Half of the room that the body takes where it drives straight on: the radius of a disc."""
        return self.radius_m if self.outline_m is None else float(np.abs(np.array(self.outline_m)[:, 1]).max())

    def beyond(self, metres: float) -> float:
        """Return the distance from the middle of the body to so far beyond its rim, m."""
        return round(self.radius_m + metres, NANO)

    def beside(self, metres: float) -> float:
        """Return the distance from the middle of a body that drives straight on to so far beside it, m."""
        return round(self.half_width_m + metres, NANO)

    @property
    def inner_m(self) -> float:
        """Radius of the largest disc about the middle of the axle within the body."""
        if self.outline_m is None:
            return self.radius_m
        corners = np.array(self.outline_m)
        after = np.roll(corners, -1, axis=0)
        doubled = corners[:, 0] * after[:, 1] - corners[:, 1] * after[:, 0]
        return float((doubled / np.hypot(*(after - corners).T)).min())

    def steps_of(self, way_m: float) -> int:
        """Return how many steps a way takes at most, if it turns no more than ways among walls do."""
        return round(max(way_m / self.step_m, way_m * TURN_OF_WAY / self.turn_rad))


def _convex(corners: tuple[tuple[float, float], ...]) -> tuple[tuple[float, float], ...]:
    """Return the corners of an outline counter-clockwise; raises RobotError where it is none that is convex.

    Bodies that are not are stated by their hull: nothing can be driven around in their notches.
    """
    points = np.array(corners, dtype=np.float64).reshape(-1, 2)
    turns = np.roll(points, -1, axis=0) - points, np.roll(points, -2, axis=0) - np.roll(points, -1, axis=0)
    left = turns[0][:, 0] * turns[1][:, 1] - turns[0][:, 1] * turns[1][:, 0]
    turned = float(np.abs(np.arctan2(left, np.vecdot(*turns)).sum()))
    is_convex = (np.all(left > 0.0) or np.all(left < 0.0)) and turned < 3.0 * np.pi
    if len(points) < 3 or not np.all(np.isfinite(points)) or not is_convex:
        raise RobotError(
            f"expected a convex outline of three corners or more, found {corners}: state its hull, in order"
        )
    points = points if left[0] > 0.0 else points[::-1]
    across = points[:, 0] * np.roll(points, -1, axis=0)[:, 1] - points[:, 1] * np.roll(points, -1, axis=0)[:, 0]
    if not np.all(across > 0.0):
        raise RobotError(
            f"expected an outline around the middle of the axle at (0, 0), found {corners}: measure it from there"
        )
    return tuple((float(x), float(y)) for x, y in points)


def of_outline(points_m: Float[np.ndarray, "n 2"]) -> float:
    """Return the radius of the disc about the middle of the axle that holds an outline, m, robot frame."""
    return float(np.hypot(points_m[:, 0], points_m[:, 1]).max())


def of_robot() -> Any:
    """Return a field of a group of settings that holds what the robot states: no setting of its own (`fitted`)."""
    return field(default=RobotSpec(), repr=False, metadata={STATED: True})


STATED = "stated once"
"""Marks a field that holds what is stated elsewhere, by the robot (`of_robot`) or for all rules (`of_shared`)."""

Settings = TypeVar("Settings")


def fitted(settings: Settings, stated: object) -> Settings:
    """Return a group of settings, and all groups within, with what is stated once: a robot, or what rules share."""
    assert is_dataclass(settings)
    assert not isinstance(settings, type)
    changes: dict[str, Any] = {}
    for each in fields(settings):
        value = getattr(settings, each.name)
        if each.metadata.get(STATED):
            changes |= {each.name: stated} if isinstance(value, type(stated)) else {}
        elif is_dataclass(value) and not isinstance(value, type):
            changes[each.name] = fitted(value, stated)
    return replace(settings, **changes)
