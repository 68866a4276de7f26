"""What is left when no open end is: floor never seen, things that are no wall; and what came of each visit there."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from chainslam.slam.geometry.quantities import Number, Part

from ..planning.driving_field import NEAR_M
from ..strategies import Choice, Place, Situation
from ..strategies.nearest import nearest_frontier, nearest_unmapped_obstacle, nearest_viewpoint
from ..survey.coastal_viewpoints import coastal_viewpoints
from ..survey.frontiers import pieces
from ..survey.trusted_walls import TrustedWalls
from .ledger import Event, Ledger


@dataclass(frozen=True)
class SweepConfig:
    """How places are visited after the last open end."""

    visits: Number = 2
    """Unseen floor, or an obstacle that is no wall of the map, is left alone after this many visits."""
    reach: Part = 0.8
    """Unseen floor far from walls is viewed from within this share of the scanner's range."""


class Sweep:
    """Chooses the next place, by what the ledger says of earlier visits."""

    def __init__(self, config: SweepConfig, ledger: Ledger, is_on: bool) -> None:
        """Without `is_on`, only look for a first wall."""
        self._config, self._ledger, self._is_on = config, ledger, is_on

    def was_in_vain(self, place_world: Float[ndarray, "2"]) -> bool:
        """Return whether going there was of no use before."""
        return self._ledger.count(Event.VISITED, place_world) >= self._config.visits

    def ended(self, place: Place, trouble: str) -> None:
        """Take note that the visit of a place ended, and what was in the way, if anything."""
        if _is_seen_from_afar(place):
            self._ledger.note(Event.VIEWED, place.centre_world)
        else:
            self._ledger.note(Event.VISITED, place.centre_world, trouble)

    def choose(self, situation: Situation) -> Choice | None:
        """Go to the nearest floor that borders on unseen floor; when none is left, to what is no wall of the map.

        Floor out of sight of the walls is looked at from where there are some in sight first.
        """
        if not len(situation.map):
            return nearest_frontier(situation, "no wall is in sight yet")
        if not self._is_on:
            return None
        why = "no open end is in reach, unseen floor is left"
        frontier = (
            nearest_viewpoint(situation, self._beside_walls(situation, only_near=True), why, NEAR_M)
            or nearest_viewpoint(situation, self._beside_walls(situation, only_near=False), why)
            or nearest_frontier(situation, why)
        )
        things = "no open end is in reach, things stand that are no wall of the map"
        return frontier or nearest_unmapped_obstacle(situation, things)

    def _beside_walls(self, situation: Situation, *, only_near: bool) -> dict[Place, Place]:
        """Return where to go with walls in sight, each with the unseen floor that is seen from there."""
        floor, range_m = situation.around.free_space, situation.around.scan.range_max_m
        coast_m, reach_m = situation.following.paths.coast_of(range_m), self._config.reach * range_m
        walls, found = TrustedWalls(situation.map), {}
        for place in situation.frontiers_near if only_near else situation.frontiers:
            if np.all(walls.near(place.points_world, coast_m)):
                found[place] = place
                continue
            for tile in pieces(place.points_world):
                middle = tile.mean(axis=0)
                if self._ledger.count(Event.VIEWED, middle):
                    continue
                spots = coastal_viewpoints(middle, walls, coast_m, reach_m, floor, situation.field, only_near=only_near)
                if len(spots):
                    found[Place(spots, place.what, place.kind, middle)] = Place(tile, place.what)
        return found


def _is_seen_from_afar(place: Place) -> bool:
    return place.kind == "unseen" and place.about_world is not None
