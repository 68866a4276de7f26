"""Goes on or returns to well-known walls, by how well the robot would know where it is (paper, section 6)."""

from collections.abc import Callable

import numpy as np
from jaxtyping import Float

from ..following.wall_following import Surroundings
from ..survey.viewpoints import ideal_places, lane
from .expectation import Expectation, expect, position_sigma, walls_seen_from
from .nearest_robot import NearestRobot
from .strategy import Choice, Place, Situation

BAR_M = 0.04
"""With a position known worse than this (one sigma, beyond the start's) the two faces of a thin wall, 0.1 m apart,
are no longer told apart at the gate of 0.99."""
RAISE = 1.5
"""After each return the bar is this much above what made the robot return: what the map does not know, no return can
mend, and so there are few."""
FALLEN = 0.5
"""A return leads to, and ends at, a position known to this share of the bar."""


class Adaptive:
    """Explores like `nearest-robot`; while the position would be known too badly, returns to well-known walls first."""

    def __init__(self) -> None:
        self._forward = NearestRobot()
        self._bar_m = BAR_M
        self._start_m: float | None = None

    def choose(self, situation: Situation) -> Choice | None:
        """Return the nearest open end, or a place beside well-known walls."""
        now = position_sigma(situation.map.belief.pose_cov)
        if self._start_m is None:
            self._start_m = now
        choice = self._forward.choose(situation)
        if choice is None or isinstance(choice.target, Place):
            return choice
        row = next(k for k, end in enumerate(situation.open_ends) if end is choice.target)
        place = ideal_places(choice.target, situation.map, situation.following.viewpoints)[0]
        metres = float(situation.nearest_end_metres[row])
        there = _expected(situation, choice.target.wall, place, metres).position_sigma_m
        worst = self._lost(max(now, there))
        if worst > self._bar_m:
            limit, self._bar_m = FALLEN * self._bar_m, RAISE * worst
            back = self._way_back(situation, limit, f"position lost {worst:.3f} m since the start")
            if back is not None:
                return back
        reason = f"{choice.reason}; position known to {now:.3f} m, there to {there:.3f} m"
        return Choice(choice.target, reason, self._while(_at_most(self._bar_m)))

    def _way_back(self, situation: Situation, limit_m: float, why: str) -> Choice | None:
        """Return the nearest place from which walls known well enough are in sight."""
        walls = situation.map
        ids = walls.ids[~walls.tentative].tolist()
        lanes = [lane(wall, walls, situation.following.viewpoints.standoff_m) for wall in ids]
        metres = np.array([situation.field.metres(points).min() for points in lanes])
        for k in np.argsort(metres, kind="stable")[: np.count_nonzero(np.isfinite(metres))]:
            middle = lanes[k][len(lanes[k]) // 2]
            known = self._lost(_expected(situation, ids[k], middle, float(metres[k])).position_sigma_m)
            if known <= limit_m:
                place = Place(lanes[k], f"wall {ids[k]} and others are known well", "known-walls")
                reason = f"{why}: back to where it is {known:.3f} m, {metres[k]:.1f} m to drive"
                return Choice(place, reason, self._while(_above(limit_m)))
        return None

    def _while(self, holds: Callable[[float], bool]) -> Callable[[Surroundings], bool]:
        """Return a condition on what the position has lost."""
        return lambda around: holds(self._lost(position_sigma(around.walls.belief.pose_cov)))

    def _lost(self, sigma_m: float) -> float:
        """Return what a position is known worse than at the start (sigma of what was added), m."""
        return float(np.sqrt(max(sigma_m**2 - (self._start_m or 0.0) ** 2, 0.0)))


def _expected(situation: Situation, wall: int, place_world: Float[np.ndarray, "2"], metres: float) -> Expectation:
    seen = walls_seen_from(situation.map, situation.graph, wall, place_world)
    return expect(situation.map, seen, place_world, metres)


def _at_most(bar_m: float) -> Callable[[float], bool]:
    return lambda lost_m: lost_m <= bar_m


def _above(limit_m: float) -> Callable[[float], bool]:
    return lambda lost_m: lost_m > limit_m
