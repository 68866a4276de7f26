"""Size limits of drawings: any drawing within them becomes a world within 20 s and 1 GB."""

from collections.abc import Collection, Sequence

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry

from .drawing import LARGEST_M, SMALLEST_M, WorldError

WALLS_MAX = 20_000
"""Straight pieces of all lines and outlines."""
MEETINGS_MAX = 200_000
"""How often pieces may touch or cross each other, including shared ends."""
FARTHEST_M = 1e7
"""Distance from the origin: enough for any projected frame, with micrometres still resolved."""
CLOSE_MAX = 150_000
"""Pairs of separate pieces closer than their widening: each costs about 70 microseconds and 6 kB."""
LABELS_MAX = 200
"""The distances of all pairs of labels are computed."""
CLOSE_M = 0.1
"""Walls are this thick."""
AT_ONCE = 100


def check_count(count: int) -> None:
    """Raise WorldError for more straight pieces than a drawing may have."""
    if count > WALLS_MAX:
        raise WorldError(f"expected at most {WALLS_MAX} straight pieces of wall, found {count}: simplify the drawing")


def check_size(lines: Sequence[shapely.LineString], polygons: Sequence[shapely.Polygon]) -> None:
    """Raise WorldError for a drawing that has too many walls, that meet too often, or lie too far off; metres."""
    rings = shapely.get_rings(np.array(polygons, dtype=object)).tolist()
    paths = [shapely.get_coordinates(path) for path in (*lines, *rings)]
    check_count(sum(len(path) - 1 for path in paths))
    if not paths:
        return
    # Not written as a comparison with the maximum: NaN is too far as well.
    if not all(np.all(np.abs(path) <= FARTHEST_M) for path in paths):
        raise WorldError(
            f"expected walls at most {FARTHEST_M:g} m from the origin, found farther ones: move the drawing, or correct"
            " its scale (--scale METRES)"
        )
    check_extent(np.concatenate(paths))
    pieces = np.concatenate([np.stack([path[:-1], path[1:]], axis=1) for path in paths])
    walls = np.array(shapely.linestrings(pieces))
    tree = shapely.STRtree(walls)
    meetings = 0
    for first in range(0, len(walls), AT_ONCE):
        some = walls[first : first + AT_ONCE]
        meetings += tree.query(some, predicate="intersects").shape[1] - len(some)
        if meetings > MEETINGS_MAX:
            raise WorldError(f"expected walls that meet at most {MEETINGS_MAX} times, found more: simplify the drawing")

    check_apart(lines, CLOSE_M)


def check_extent(points: Float[np.ndarray, "n 2"]) -> None:
    """Raise WorldError if the extent of a building, m, shows that its scale is wrong."""
    extent = float(np.max(np.ptp(points, axis=0)))
    if not SMALLEST_M <= extent <= LARGEST_M:
        raise WorldError(
            f"expected a building of {SMALLEST_M:g} to {LARGEST_M:g} m, found {extent:.3g} m:"
            " correct the scale (--scale METRES)"
        )


def check_apart(shapes: Sequence[BaseGeometry], distance_m: float) -> None:
    """Raise WorldError if too many pieces of lines or outlines are closer than they are widened by."""
    parts = shapely.get_parts(shapely.get_parts(np.array([*shapes, shapely.LineString()], dtype=object)))
    rings = shapely.get_rings(parts[shapely.get_type_id(parts) == shapely.GeometryType.POLYGON])
    lines = parts[shapely.get_type_id(parts) == shapely.GeometryType.LINESTRING]
    paths = [shapely.get_coordinates(path) for path in (*lines, *rings)]
    pieces = np.concatenate([np.stack([path[:-1], path[1:]], axis=1) for path in paths])
    walls = np.array(shapely.linestrings(pieces))
    tree = shapely.STRtree(walls)
    close = 0
    for first in range(0, len(walls), AT_ONCE):
        some = walls[first : first + AT_ONCE]
        near = tree.query(some, predicate="dwithin", distance=distance_m).shape[1]
        close += near - tree.query(some, predicate="intersects").shape[1]
        if close > CLOSE_MAX:
            raise WorldError(
                f"expected walls apart from each other, found more than {CLOSE_MAX} pairs nearer than {distance_m:g} m:"
                " correct the scale (--scale METRES), or simplify the drawing"
            )


def check_labels(names: Collection[str]) -> None:
    """Raise WorldError for more named points than a world may have."""
    if len(names) > LABELS_MAX:
        raise WorldError(f"expected at most {LABELS_MAX} named points, found {len(names)}: remove some")
