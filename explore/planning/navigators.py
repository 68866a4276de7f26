"""How the robot finds its way to a place: by a sequence of walls, or over all the floor that it has seen free."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, Protocol

import networkx as nx
import numpy as np
from jaxtyping import Float

from chainslam.slam.map.stochastic_map import StochasticMap

from .paths import Path, Planner
from .wall_sequence import WallSearch

Navigation = Literal["floor", "visibility"]


@dataclass(frozen=True, eq=False)
class Surveyed:
    """What is known of the walls where a way is sought."""

    walls: StochasticMap
    graph: nx.DiGraph[int]
    """The visibility graph."""
    standoff_m: float
    reach_m: float
    """Walls this near to the robot are in sight."""


@dataclass(frozen=True, eq=False)
class Way:
    """A way to one of the places asked for."""

    path: Path
    planner: Planner
    """Of the floor to which the way keeps."""
    walls: tuple[int, ...] | None = None
    """Ids of the walls along which it leads, in order, none where it is straight; None where no wall counted."""


class Navigator(Protocol):
    """The middle layer: from places to the way there."""

    no_way: str
    """Why a place on floor that hangs together with the robot's may yet be out of reach; empty if it never is."""

    def way(self, planner: Planner, places_world: Float[np.ndarray, "n 2"], known: Surveyed) -> Way | None:
        """Return the way to one of some places; None where none leads to any."""
        ...


class FloorNavigator:
    """Takes the cheapest way over all the floor seen free."""

    no_way = ""

    def way(self, planner: Planner, places_world: Float[np.ndarray, "n 2"], known: Surveyed) -> Way | None:
        """Return the cheapest way to the cheapest of some places."""
        path = planner.to(places_world) if len(places_world) else None
        return None if path is None else Way(path, planner)


class WallNavigator:
    """Goes along walls, and straight from one to the next; the floor tells where the body fits, and nothing else."""

    no_way = "no sequence of walls leads there"

    def way(self, planner: Planner, places_world: Float[np.ndarray, "n 2"], known: Surveyed) -> Way | None:
        """Return the way by the shortest sequence of walls that leads to one of some places."""
        search = WallSearch(known.graph, known.walls, planner, known.standoff_m, known.reach_m)
        found = search.to(places_world)
        if found is None:
            return None
        kept = planner.within(found.cells)
        path = kept.to(places_world)
        return None if path is None else Way(path, kept, found.walls)


NAVIGATORS: Mapping[Navigation, Navigator] = MappingProxyType(
    {"floor": FloorNavigator(), "visibility": WallNavigator()}
)
"""By name: `--navigation`."""
