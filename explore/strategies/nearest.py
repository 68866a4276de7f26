"""What several strategies share: the nearest of some open ends, of some places."""

from collections.abc import Callable, Sequence
from functools import partial

import numpy as np
from jaxtyping import Float

from ..following.surroundings import Surroundings
from ..survey.frontiers import borders_on_unseen
from ..survey.unmapped_obstacles import is_mapped
from .strategy import Choice, Place, Situation

STILL_UNSEEN = 0.5
"""A frontier is worth the way while this share of it borders on floor that nobody saw."""


def nearest_end(
    situation: Situation, metres: Float[np.ndarray, " n"] | None = None, among: Sequence[int] | None = None
) -> int | None:
    """Return which open end has the least of `metres`, by its place in `open_ends`; None if no way leads to any.

    Without `metres` it is the shortest drive that counts. `among` are the places in `open_ends` that count.
    """
    nearest_wanted = metres is None and among is None
    drives = situation.nearest_end_metres if nearest_wanted else situation.end_metres
    metres = drives if metres is None else metres
    rows = np.arange(len(metres)) if among is None else np.asarray(among, dtype=np.int64)
    rows = rows[np.isfinite(drives[rows])]
    return int(rows[np.argmin(metres[rows])]) if len(rows) else None


def straight_to_nearest_end(situation: Situation) -> Choice:
    """Return the open end to which the straight way is shortest: no way to stand before any is known yet."""
    gaps = [np.hypot(*(end.position_world - situation.around.pose_world[:2])) for end in situation.open_ends]
    end = situation.open_ends[int(np.argmin(gaps))]
    return Choice(end, "no way to stand before any open end is known; nearest")


def nearest_frontier(situation: Situation, what: str) -> Choice | None:
    """Return the nearest border of seen floor, as a goal for as long as half of it still borders on unseen floor."""

    def is_left(place: Place, around: Surroundings) -> bool:
        return bool(np.mean(borders_on_unseen(around.free_space, place.points_world)) >= STILL_UNSEEN)

    return _nearest(situation, situation.frontiers, f"{what}: nearest of {{}} borders of seen floor", is_left)


def nearest_unmapped_obstacle(situation: Situation, what: str) -> Choice | None:
    """Return the nearest thing that is no wall of the map, as a goal until a wall stands there."""

    def is_left(place: Place, around: Surroundings) -> bool:
        return not is_mapped(around.walls, place.centre_world)

    return _nearest(situation, situation.unmapped_obstacles, f"{what}: nearest of {{}}", is_left)


def nearest_left(situation: Situation, sweep: bool) -> Choice | None:
    """Return what is left when no open end is: unseen floor, then things that are no wall of the map.

    Without `sweep` it is only a first wall that is looked for.
    """
    if not len(situation.map):
        return nearest_frontier(situation, "no wall is in sight yet")
    if not sweep:
        return None
    things = "no open end is in reach, things stand that are no wall of the map"
    frontier = nearest_frontier(situation, "no open end is in reach, unseen floor is left")
    return frontier or nearest_unmapped_obstacle(situation, things)


def _nearest(
    situation: Situation, places: Sequence[Place], words: str, is_left: Callable[[Place, Surroundings], bool]
) -> Choice | None:
    """Return the place that is the shortest drive away, with the reason in `words`, which has a gap for how many."""
    if not places:
        return None
    sizes = [len(place.points_world) for place in places]
    metres = situation.field.metres(np.concatenate([place.points_world for place in places]))
    nearest = np.minimum.reduceat(metres, np.cumsum([0, *sizes[:-1]]))
    best = int(np.argmin(nearest))
    if not np.isfinite(nearest[best]):
        return None
    reason = f"{words.format(len(places))}, {nearest[best]:.1f} m to drive"
    return Choice(places[best], reason, partial(is_left, places[best]))
