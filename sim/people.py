"""People in a simulated building: discs that walk about, or stand in one place for a time, and hide what is behind."""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from jaxtyping import Float
from msgspec import Meta

from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.geometry.quantities import Body, Distance, Pace, Place, Wait
from chainslam.slam.robot import RobotError

from .chance import Chance, Channel

TRIES = 24
"""Directions that a person tries before waiting where it is."""
DRAWS = 64
"""Draws that one person's decisions of a step may take."""


@dataclass(frozen=True)
class PeopleConfig:
    """People in the building that the software is not told about; by default there are none."""

    walking: Annotated[int, Meta(ge=0, le=1000)] = 0
    """Number of people who walk straight on until something is in the way, and then in another direction."""
    radius_m: Body = 0.2
    """Radius of a person at the height of the scanner."""
    speed_m_s: Pace = 0.8
    """Walking speed."""
    keep_m: Distance = 0.1
    """Smallest distance that people keep from walls and from the robot's body."""
    standing: tuple[Place, ...] = ()
    """Positions of people who stand still: x and y of the first in the world frame, then of the second, and so on."""
    leave_s: Wait = 1e9
    """Time on the robot's clock at which the standing people leave."""

    def __post_init__(self) -> None:
        """Raise RobotError for people that cannot be."""
        if len(self.standing) % 2:
            raise RobotError(
                f"expected x and y of each standing person, found {len(self.standing)} numbers: give an even count"
            )


@dataclass
class People:
    """Where the people are, step by step."""

    config: PeopleConfig
    faces: Float[np.ndarray, "n 2 2"]
    """The true faces, world frame, m."""
    chance: Chance
    robot_radius_m: float
    _places: Float[np.ndarray, "p 2"] = field(default_factory=lambda: np.zeros((0, 2)))
    _headings: Float[np.ndarray, " p"] = field(default_factory=lambda: np.zeros(0))
    _moves: int = 0

    def places_at(self, time_s: float) -> Float[np.ndarray, "m 2"]:
        """Return where people stand or walk now, world frame, m."""
        if not self.config.standing or time_s >= self.config.leave_s:
            return self._places
        return np.concatenate([self._places, np.reshape(self.config.standing, (-1, 2))])

    def enter(self, robot_world: Float[np.ndarray, "2"], reach_m: float) -> None:
        """Let those who walk stand about the robot, each in a free place within reach that it could see."""
        draws = self.chance.uniforms(Channel.PEOPLE, 0, 2 * TRIES * DRAWS * max(self.config.walking, 1))
        found: list[Float[np.ndarray, 2]] = []
        for radius, angle in draws.reshape(-1, 2):
            if len(found) == self.config.walking:
                break
            direction = np.array([np.cos(2 * np.pi * angle), np.sin(2 * np.pi * angle)])
            place = robot_world + (1.0 + radius * max(reach_m - 1.0, 0.0)) * direction
            if self._is_free(robot_world, place, robot_world, np.reshape(found, (-1, 2))):
                found.append(place)
        self._places = np.reshape(found, (-1, 2))
        self._headings = np.zeros(len(found))

    def walk(self, seconds: float, robot_world: Float[np.ndarray, "2"]) -> None:
        """Let everybody walk for so long, past a robot that stands where it is."""
        self._moves += 1
        if not len(self._places):
            return
        draws = self.chance.uniforms(Channel.PEOPLE, self._moves, len(self._places) * TRIES).reshape(-1, TRIES)
        way_m = self.config.speed_m_s * seconds
        for k, own in enumerate(draws):
            others = np.delete(self._places, k, axis=0)
            for heading in (self._headings[k], *(2.0 * np.pi * own)):
                place = self._places[k] + way_m * np.array([np.cos(heading), np.sin(heading)])
                if self._is_free(self._places[k], place, robot_world, others):
                    self._places[k], self._headings[k] = place, heading
                    break

    def _is_free(
        self,
        start: Float[np.ndarray, "2"],
        end: Float[np.ndarray, "2"],
        robot_world: Float[np.ndarray, "2"],
        others: Float[np.ndarray, "m 2"],
    ) -> bool:
        """Return whether a person gets straight from one place to another, past walls, the robot and others."""
        body = self.config.radius_m + self.config.keep_m
        count = 1 + int(np.ceil(np.hypot(*(end - start)) / (0.5 * body)))
        way = start + np.linspace(0.0, 1.0, count + 1)[1:, None] * (end - start)
        if distance_to_segments(way, self.faces).min(initial=np.inf) < body:
            return False
        gaps = np.hypot(*(way - robot_world).T)
        nearer = gaps < body + self.robot_radius_m
        if np.any(nearer & (gaps < np.hypot(*(start - robot_world)))):
            return False
        return bool(np.hypot(*(others - end).T).min(initial=np.inf) > 2.0 * self.config.radius_m)


def hidden_by(
    ranges: Float[np.ndarray, " k"],
    bearings_world: Float[np.ndarray, " k"],
    scanner_world: Float[np.ndarray, "2"],
    places_world: Float[np.ndarray, "m 2"],
    radius_m: float,
) -> Float[np.ndarray, " k"]:
    """Return ranges (k,) m cut short where a beam meets a disc of this radius at some places (m, 2) first."""
    if not len(places_world):
        return ranges
    offsets = places_world - scanner_world
    along = np.cos(bearings_world)[:, None] * offsets[:, 0] + np.sin(bearings_world)[:, None] * offsets[:, 1]
    square = along**2 - np.sum(offsets**2, axis=1) + radius_m**2
    to_disc = np.where((square >= 0.0) & (along > 0.0), along - np.sqrt(np.maximum(square, 0.0)), np.inf)
    return np.minimum(ranges, np.maximum(to_disc, 1e-3).min(axis=1))
