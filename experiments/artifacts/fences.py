"""The argument of `--fence`: a box in four numbers, or a file with a polygon."""

from pathlib import Path
from typing import Any

import numpy as np
import shapely
from shapely.errors import GEOSException

from chainslam.sim.logs.archive import regular

from ..usage import UsageError

SHAPE = "a fence as X0,Y0,X1,Y1 in metres or a GeoJSON file with one polygon"


def fence_of(text: str) -> list[list[float]]:
    """Return the corners of a fence, m, world frame; raises UsageError for anything else."""
    parts = text.split(",")
    if len(parts) == 4:
        try:
            x0, y0, x1, y1 = (float(part) for part in parts)
        except ValueError:
            x0 = x1 = np.nan
        if np.all(np.isfinite([x0, x1])) and np.all(np.isfinite([y0, y1])) and x0 != x1 and y0 != y1:
            return [[x0, y0], [x1, y0], [x1, y1], [x0, y1]]
        raise UsageError(f"expected {SHAPE}, found {text[:60]!r}: write four different numbers")
    try:
        polygon = _polygon(shapely.from_geojson(regular(Path(text)).read_text(encoding="utf-8")))
    except (OSError, UnicodeDecodeError, GEOSException) as error:
        reason = getattr(error, "strerror", None) or "no GeoJSON"
        raise UsageError(f"expected {SHAPE}, found {Path(text).name} ({reason}): name another") from error
    if polygon is None or not polygon.is_valid or polygon.area <= 0.0:
        raise UsageError(f"expected {SHAPE}, found {Path(text).name} without a valid one: redraw it")
    return [list(point) for point in shapely.get_coordinates(polygon.exterior)[:-1].tolist()]


def _polygon(shape: Any) -> shapely.Polygon | None:
    """Return the one polygon in a geometry, or None."""
    parts = [part for part in shapely.get_parts(shape, return_index=False) if isinstance(part, shapely.Polygon)]
    return parts[0] if len(parts) == 1 else None
