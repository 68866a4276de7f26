"""The ledger: what was given up, where and why; the explorer, the sweep and the certificate read this one."""

from __future__ import annotations

from dataclasses import dataclass, replace
from enum import Enum

import numpy as np
from jaxtyping import Float

from chainslam.slam.map.chains import OpenEnd

from ..goal import GivenUp, LeftPlace, SetAside

Key = tuple[int, int]
"""An end of a wall: its id and the side."""


class Event(Enum):
    """What happened at a place."""

    SET_ASIDE = "an open end here was blacklisted"
    GONE = "an open end here that the robot was exploring was gone"
    VISITED = "the robot was sent to unseen floor or an unmapped obstacle here"
    VIEWED = "the robot was sent to look at unseen floor here from a distance"


@dataclass(frozen=True)
class EndRecord:
    """What is remembered of one end."""

    set_aside: SetAside | None = None
    """Why it is set aside; None while it may be tried."""
    was_walked: bool = False
    """Whether the robot was sent along its wall because nothing of the end could be seen."""
    known_cells: int | None = None
    """How much floor around it was known when no look at it was possible; None where one was."""


@dataclass(frozen=True)
class PlaceRecord:
    """Something that happened at a place."""

    event: Event
    position_world: Float[np.ndarray, 2]
    trouble: str = ""
    """What was in the way, in words; nothing, if the robot got there."""


class Ledger:
    """One record for each end that was tried, and one for each event at a place."""

    def __init__(self, near_m: float) -> None:
        """Take places within `near_m` of each other for one."""
        self._near_m = near_m
        self._ends: dict[Key, EndRecord] = {}
        self._places: list[PlaceRecord] = []

    @property
    def set_aside(self) -> dict[Key, SetAside]:
        """The ends that are set aside, in the order in which that was done."""
        return {key: end.set_aside for key, end in self._ends.items() if end.set_aside is not None}

    @property
    def given_up(self) -> GivenUp:
        """The ends that are set aside and the places that were left, as they are now."""
        left = (LeftPlace(e.position_world, e.trouble) for e in self._places if e.event is Event.VISITED)
        return GivenUp(tuple(self.set_aside.values()), tuple(left), self._near_m)

    def end(self, key: Key) -> EndRecord:
        """Return what is remembered of an end."""
        return self._ends.get(key, EndRecord())

    def put_aside(self, end: OpenEnd, reason: str, known_cells: int | None = None) -> None:
        """Set an end aside; `known_cells` where no look at it was possible."""
        key = (end.wall, end.side)
        record = self._ends.pop(key, EndRecord())
        aside = SetAside(end.wall, end.side, end.position_world, reason)
        known = record.known_cells if known_cells is None else known_cells
        self._ends[key] = replace(record, set_aside=aside, known_cells=known)

    def take_up(self, key: Key) -> None:
        """Let an end that was set aside be tried again."""
        self._ends[key] = replace(self.end(key), set_aside=None)

    def take_up_unlooked(self, key: Key) -> None:
        """Let an end be tried again at which no look was possible: now one may be."""
        self._ends[key] = replace(self.end(key), set_aside=None, known_cells=None)

    def take_up_all(self) -> None:
        """Let every end and every place be tried again, as if none had been: what stood in the way may be gone."""
        self._ends = {}
        self._places = []

    def note_walk(self, key: Key) -> None:
        """Take note that the robot is sent along the wall of an end."""
        self._ends[key] = replace(self.end(key), was_walked=True)

    def note(self, event: Event, position_world: Float[np.ndarray, 2], trouble: str = "") -> None:
        """Take note of something that happened at a place, m."""
        self._places.append(PlaceRecord(event, position_world, trouble))

    def count(self, event: Event, position_world: Float[np.ndarray, 2]) -> int:
        """Return how often something happened near a place, m."""
        places = np.array([each.position_world for each in self._places if each.event is event]).reshape(-1, 2)
        return int(np.count_nonzero(np.hypot(*(places - position_world).T) < self._near_m))

    def unlooked(self) -> list[tuple[Key, int]]:
        """Return the ends at which no look was possible, with how much of the floor around was known then."""
        return [(key, end.known_cells) for key, end in self._ends.items() if end.known_cells is not None]
