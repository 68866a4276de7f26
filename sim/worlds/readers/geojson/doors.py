"""Rooms that share their walls, and the doors that are drawn apart from them."""

from collections.abc import Sequence

import numpy as np
import shapely
from jaxtyping import Float

from ...rooms import SHUT_M, areas

REACH_M = 0.3
"""A door is drawn on its wall or on a face of it: what is solid so near on either side of it opens."""
DOOR_M = 0.9
"""Width of a door that is a point and does not say it."""
NEAR_M = 0.5
"""A door that is a point lies so near to its wall."""


def shared_walls(rooms: Sequence[shapely.Polygon]) -> list[shapely.LineString]:
    """Return the edges along which rooms touch each other: walls that both draw."""
    tree = shapely.STRtree(rooms)
    first, second = tree.query(np.array(rooms, dtype=object), predicate="dwithin", distance=SHUT_M)
    walls = []
    for i, j in zip(first, second, strict=True):
        if i < j:
            # Where both have the very same edge, its ends are known; else they lie within the width of the slit.
            same = rooms[i].boundary.intersection(rooms[j].boundary)
            near = rooms[i].boundary.intersection(rooms[j].buffer(SHUT_M, join_style="mitre"))
            parts = shapely.get_parts(shapely.get_parts(same if same.length > 0.5 * near.length else near))
            merged = shapely.line_merge(shapely.multilinestrings([p for p in parts if p.geom_type == "LineString"]))
            walls += [part for part in shapely.get_parts(merged) if part.length > 4 * SHUT_M]
    return walls


def opening(line: shapely.LineString) -> list[shapely.Polygon]:
    """Return what opens along a door that is drawn as a line."""
    return areas(line.buffer(REACH_M, cap_style="flat", join_style="mitre"))


def at_point(
    place: Float[np.ndarray, "2"], width_m: float | None, walls: Sequence[shapely.LineString]
) -> shapely.LineString | None:
    """Return the line of a door that is a point on a wall; None where no wall is near."""
    at = shapely.Point(place)
    nearest = min(walls, key=at.distance, default=None)
    if nearest is None or at.distance(nearest) > NEAR_M:
        return None
    half, along = 0.5 * (width_m or DOOR_M), nearest.project(at)
    # Straight on where the door stands, also beyond the wall's corner.
    ends = [nearest.interpolate(min(max(along + step, 0.0), nearest.length)) for step in (-0.01, 0.01)]
    a, b = (np.array([end.x, end.y]) for end in ends)
    size = float(np.hypot(*(b - a)))
    if size == 0.0:
        return None
    middle = np.array(nearest.interpolate(along).coords[0])
    reach = half * (b - a) / size
    return shapely.LineString([middle - reach, middle + reach])
