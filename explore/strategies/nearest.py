"""What several strategies share: the nearest of some open ends, of some places."""

from collections.abc import Callable, Mapping, Sequence

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


def nearest_place(
    situation: Situation, places: Sequence[Place], within_m: float = np.inf
) -> tuple[Place, float] | None:
    """Return the place that is the shortest drive away, and how far, m; None if no way so short leads to any."""
    if not places:
        return None
    sizes = [len(place.points_world) for place in places]
    points = np.concatenate([place.points_world for place in places])
    metres = situation.field.metres(points, beyond_nearest=within_m == np.inf)
    nearest = np.minimum.reduceat(metres, np.cumsum([0, *sizes[:-1]]))
    best = int(np.argmin(nearest))
    is_there = np.isfinite(nearest[best]) and nearest[best] <= within_m
    return (places[best], float(nearest[best])) if is_there else None


def nearest_frontier(situation: Situation, what: str) -> Choice | None:
    """Return the nearest border of seen floor, as a goal for as long as half of it still borders on unseen floor."""
    return _nearest(situation, situation.frontiers, f"{what}: nearest of {{}} borders of seen floor", _still_frontier)


def nearest_viewpoint(
    situation: Situation, seen: Mapping[Place, Place], what: str, within_m: float = np.inf
) -> Choice | None:
    """Return the nearest place from which another is seen, as a goal while half of that borders on unseen floor."""
    words = f"{what}: in sight of walls, nearest of {{}}"
    return _nearest(situation, list(seen), words, lambda stand: _still_frontier(seen[stand]), within_m)


def nearest_unmapped_obstacle(situation: Situation, what: str) -> Choice | None:
    """Return the nearest thing that is no wall of the map, as a goal until a wall stands there."""
    return _nearest(situation, situation.unmapped_obstacles, f"{what}: nearest of {{}}", _still_unmapped)


def _nearest(
    situation: Situation,
    places: Sequence[Place],
    words: str,
    holds: Callable[[Place], Callable[[Surroundings], bool]],
    within_m: float = np.inf,
) -> Choice | None:
    """Return the nearest place as a choice, with the reason in `words`, which has a gap for how many there are."""
    found = nearest_place(situation, places, within_m)
    if found is None:
        return None
    place, metres = found
    return Choice(place, f"{words.format(len(places))}, {metres:.1f} m to drive", holds(place))


def _still_unmapped(place: Place) -> Callable[[Surroundings], bool]:
    return lambda around: not is_mapped(around.walls, place.centre_world)


def _still_frontier(place: Place) -> Callable[[Surroundings], bool]:
    return lambda around: bool(np.mean(borders_on_unseen(around.free_space, place.points_world)) >= STILL_UNSEEN)
