"""Filled outlines as polygons, also where they cross themselves."""

import numpy as np
import shapely
from jaxtyping import Float


def filled(rings: list[Float[np.ndarray, "_ 2"]], even_odd: bool) -> list[shapely.Polygon]:
    """Return the polygons that a drawing program fills inside rings (closed where open), by winding number."""
    closed = [np.concatenate([ring, ring[:1]]) for ring in rings if len(ring) > 2]
    if not closed:
        return []
    cells = shapely.get_parts(shapely.polygonize([shapely.union_all(shapely.linestrings(ring)) for ring in closed]))
    if len(closed) > 1 or len(cells) > 1 or not len(cells):
        noded = shapely.node(shapely.multilinestrings([shapely.LineString(ring) for ring in closed]))
        cells = shapely.get_parts(shapely.polygonize(shapely.get_parts(noded)))
    inside = shapely.get_coordinates(shapely.point_on_surface(cells))
    turns = np.sum([_turns(ring, inside) for ring in closed], axis=0)
    keep = turns % 2 == 1 if even_odd else turns != 0
    merged = shapely.get_parts(shapely.union_all(cells[keep]))
    return [part for part in merged if part.geom_type == "Polygon"]


def _turns(ring: Float[np.ndarray, "n 2"], points: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, " m"]:
    """Return how often a closed ring winds around each point."""
    (x0, y0), (x1, y1) = ring[:-1].T[:, None, :], ring[1:].T[:, None, :]
    x, y = points[:, :1], points[:, 1:]
    left = (x1 - x0) * (y - y0) - (x - x0) * (y1 - y0)
    up, down = (y0 <= y) & (y1 > y) & (left > 0), (y0 > y) & (y1 <= y) & (left < 0)
    turns: Float[np.ndarray, " m"] = np.sum(up, axis=1, dtype=float) - np.sum(down, axis=1, dtype=float)
    return turns
