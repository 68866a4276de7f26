"""Solid pixels as polygons whose right angles are right, and whose slanted walls are straight."""

import math

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int
from skimage.measure import find_contours, label

from ..drawing import Drawing, WorldError
from ..solid import drop_collinear
from .picture import STRIP_PIXELS

EDGES_MAX = 1_000_000
"""Sides of pixels between wall and free floor: 50 km of them at 0.05 m; noise and patterns have more."""
SPECK_PIXELS = 6
STRAIGHT_PIXELS = 1.0
"""Slanted walls are stairs of pixels: what deviates less than this from straight is straight."""


def outlines(solid: Bool[np.ndarray, "h w"], metres: float, origin: Float[np.ndarray, "3"]) -> Drawing:
    """Return the outlines of solid pixels as polygons in the frame of the map's origin (x, y, yaw).

    Raises WorldError where there is no wall, no free floor, or so much outline that this is no plan of a building.
    """
    height = len(solid)
    solid, corner = _about_the_free(solid)
    kept = _without_specks(solid)
    if not kept.any():
        raise WorldError("expected dark walls on a light ground, found no dark line in the image: draw the walls")
    edges = sum(int(np.count_nonzero(np.diff(kept, axis=axis))) for axis in (0, 1))
    if edges > EDGES_MAX:
        raise WorldError(
            f"expected at most {EDGES_MAX} sides of pixels between wall and free floor, found {edges}: this is noise"
            " or a pattern; smooth the picture, or shrink it"
        )
    found = find_contours(np.pad(kept, 1), 0.5, fully_connected="high")  # type: ignore[no-untyped-call]
    rings = [_square(ring[:-1]) for ring in found if len(ring) > 4]
    moved = [_to_world(ring + corner, height, metres, origin) for ring in rings]
    area = shapely.build_area(shapely.geometrycollections([shapely.LinearRing(ring) for ring in moved]))
    corners = 0.5 + np.array([(0, 0), (0, kept.shape[1]), kept.shape, (kept.shape[0], 0)])
    parts = [part for part in shapely.get_parts(area) if part.geom_type == "Polygon"]
    sheet = shapely.Polygon(_to_world(corners + corner, height, metres, origin))
    return Drawing(solids=tuple(parts), sheet=sheet, simplify_m=STRAIGHT_PIXELS * metres)


def _about_the_free(solid: Bool[np.ndarray, "h w"]) -> tuple[Bool[np.ndarray, "i j"], Int[np.ndarray, "2"]]:
    """Return the part of a picture around its free pixels, a solid pixel about it, and where it begins.

    A robot's map is mostly unknown: what lies about the floor is solid, however much of it there is.
    """
    spans = []
    for axis in (1, 0):
        free = np.flatnonzero(~solid.all(axis=axis))
        if not len(free):
            raise WorldError("expected light free space, found only dark or unknown pixels: check the image's greys")
        spans.append((max(int(free[0]) - 1, 0), int(free[-1]) + 2))
    (top, bottom), (left, right) = spans
    return solid[top:bottom, left:right], np.array([top, left])


def _without_specks(solid: Bool[np.ndarray, "h w"]) -> Bool[np.ndarray, "h w"]:
    """Return the solid pixels without clusters too small to be a thing that stands there."""
    clusters = label(solid, connectivity=2)  # type: ignore[no-untyped-call]
    count = int(clusters.max()) + 1
    sizes = np.zeros(count, dtype=np.int64)
    for strip in np.array_split(clusters, clusters.size // STRIP_PIXELS + 1):
        sizes += np.bincount(strip.ravel(), minlength=count)
    keep = sizes >= SPECK_PIXELS
    keep[0] = False
    kept: Bool[np.ndarray, "h w"] = keep[clusters]
    return kept


def _square(ring: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
    """Return a ring of pixel outlines (row, column) whose right angles, cut by the tracing, are corners again."""
    ring = drop_collinear(ring)
    after = np.roll(ring, -1, axis=0)
    edge = after - ring
    before, behind = np.roll(edge, 1, axis=0), np.roll(edge, -1, axis=0)
    length = np.abs(edge).sum(axis=1)
    chamfer = (np.abs(np.abs(edge) - 0.5) < 1e-9).all(axis=1) & (np.abs(np.sum(before * behind, axis=1)) < 1e-9)
    chamfer &= (np.roll(length, 1) >= 1) & (np.roll(length, -1) >= 1)
    chamfer &= (np.abs(before).min(axis=1) < 1e-9) & (np.abs(behind).min(axis=1) < 1e-9)
    corner = ring + np.where(np.abs(before) > 1e-9, edge, 0.0)
    squared: Float[np.ndarray, "m 2"] = np.where(chamfer[:, None], corner, ring)[~np.roll(chamfer, 1)]
    return squared


def _to_world(
    pixels: Float[np.ndarray, "n 2"], height: int, metres: float, origin: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "n 2"]:
    """Return (row, column) of the padded picture in the world frame, m; the origin is the lower left pixel's corner."""
    x, y = (pixels[:, 1] - 0.5) * metres, (height - pixels[:, 0] + 0.5) * metres
    c, s = math.cos(origin[2]), math.sin(origin[2])
    return np.stack([origin[0] + c * x - s * y, origin[1] + s * x + c * y], axis=1)
