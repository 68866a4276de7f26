"""What several strategies share: the nearest of some open ends, of some places."""

from collections.abc import Callable, Sequence

import numpy as np
from jaxtyping import Float

from ..unexplained import is_explained
from ..unseen import borders_on_unseen
from ..wall_following import Surroundings
from .strategy import Choice, Place, Situation


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


def nearest_place(situation: Situation, places: Sequence[Place]) -> tuple[Place, float] | None:
    """Return the place that is the shortest drive away, and how far, m; None if no way leads to any."""
    if not places:
        return None
    sizes = [len(place.points_world) for place in places]
    metres = situation.field.metres(np.concatenate([place.points_world for place in places]))
    nearest = np.minimum.reduceat(metres, np.cumsum([0, *sizes[:-1]]))
    best = int(np.argmin(nearest))
    return (places[best], float(nearest[best])) if np.isfinite(nearest[best]) else None


def nearest_unseen(situation: Situation, what: str) -> Choice | None:
    """Return the nearest border of seen floor, as a goal for as long as half of it still borders on unseen floor."""
    found = nearest_place(situation, situation.unseen)
    if found is None:
        return None
    place, metres = found
    reason = f"{what}: nearest of {len(situation.unseen)} borders of seen floor, {metres:.1f} m to drive"
    return Choice(place, reason, _still_unseen(place))


def nearest_unexplained(situation: Situation, what: str) -> Choice | None:
    """Return the nearest thing that is no wall of the map, as a goal until a wall stands there."""
    found = nearest_place(situation, situation.unexplained)
    if found is None:
        return None
    place, metres = found
    reason = f"{what}: nearest of {len(situation.unexplained)}, {metres:.1f} m to drive"
    return Choice(place, reason, lambda around: not is_explained(around.walls, place.centre_world))


def _still_unseen(place: Place) -> Callable[[Surroundings], bool]:
    return lambda around: bool(np.mean(borders_on_unseen(around.free_space, place.points_world)) >= 0.5)
