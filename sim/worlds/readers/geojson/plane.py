"""Conversion of a file's coordinates to metres in a plane.

A building is small: longitudes and latitudes are projected to the plane around its middle (plate carree with the radii
of curvature of WGS 84 there), with an error below 0.1 mm per metre over 1 km. Web Mercator is scaled by the cosine of
its latitude, on the sphere. The distortion of projections in metres, 0.04 % for UTM, is not corrected.
"""

import math
import re
from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ...drawing import WorldError, shorten

DEGREES = (4326, 4258, 4269, 4979, 4267, 4171, 4937)
MERCATOR = (3857, 900913, 3785, 102100, 102113)
METRES = (
    *range(32601, 32661), *range(32701, 32761), *range(25828, 25839), *range(3034, 3036), *range(31466, 31470),
    *range(31254, 31260), *range(5513, 5515), *range(26901, 26924), *range(28348, 28359), *range(7846, 7860),
    *(2056, 21781, 2154, 27700, 28992, 31370, 31287, 3067, 3006, 2180, 2193, 3763, 5514, 3301, 3346, 2065, 3765, 3794),
)  # fmt: skip
"""Projections in metres, by their numbers in the EPSG registry: UTM and the national ones of many countries."""
RADIUS_M, FLATTENING = 6378137.0, 1 / 298.257223563
Plane = Callable[[Float[np.ndarray, "n 2"]], Float[np.ndarray, "n 2"]]


@dataclass(frozen=True)
class Laid:
    """How coordinates become metres, and who said so, in words."""

    plane: Plane
    words: str


def laid(document: dict[str, Any], bounds: tuple[float, float, float, float], scale: float | None) -> Laid:
    """Return how the coordinates of a file within `bounds` (x0, y0, x1, y1) become metres.

    Raises WorldError for a reference system whose unit is not known here.
    """
    if scale is not None:
        return Laid(lambda at: scale * at, f"{scale:.4g} m a unit, given")
    crs = document.get("crs")
    named = "" if crs is None else _name(crs)
    number = _number(named)
    if number in DEGREES or "CRS84" in named or (crs is None and _is_geographic(bounds)):
        return _flat(bounds, "the file says" if crs is not None else "they look like it")
    if number in MERCATOR:
        return _unmercatored(bounds)
    plain = not named or number in METRES or any(word in named for word in ("LOCAL", "METRE", "METER"))
    if not plain:
        raise WorldError(
            f"expected GeoJSON in metres or in degrees, found the reference system {shorten(named)}: project it to"
            " metres, or state metres a unit (--scale 1, or --scale 0.3048 for feet)"
        )
    return Laid(lambda at: at, "in metres, as the file says" if number in METRES else "in metres")


def _name(crs: Any) -> str:
    properties = crs.get("properties") if isinstance(crs, dict) else None
    value = properties.get("name", properties.get("code", "")) if isinstance(properties, dict) else crs
    return str(value if value is not None else crs).upper() or str(crs).upper()


def _number(named: str) -> int | None:
    found = re.search(r"(?:EPSG|ESRI)[:/]*(?:[\d.]*[:/])?(\d{4,6})$", named.strip().rstrip("/"))
    return int(found[1]) if found else None


def _is_geographic(bounds: tuple[float, float, float, float]) -> bool:
    """Return whether these are surely degrees: in metres all would be a speck far from the origin."""
    x0, y0, x1, y1 = bounds
    inside = max(abs(x0), abs(x1)) <= 180 and max(abs(y0), abs(y1)) <= 90
    return bool(inside and max(x1 - x0, y1 - y0) < 0.5 and max(abs(x0), abs(y0)) > 1)


def _flat(bounds: tuple[float, float, float, float], who: str) -> Laid:
    x0, y0, x1, y1 = bounds
    if max(abs(x0), abs(x1)) > 180 or max(abs(y0), abs(y1)) > 90:
        raise WorldError(
            f"expected longitudes and latitudes, as the file's crs says, found ({x0:.6g}, {y0:.6g}): correct the crs"
        )
    middle = np.array([0.5 * (x0 + x1), 0.5 * (y0 + y1)])
    lat = math.radians(middle[1])
    squared = FLATTENING * (2 - FLATTENING)
    bent = 1 - squared * math.sin(lat) ** 2
    north, east = RADIUS_M * (1 - squared) / bent**1.5, RADIUS_M / math.sqrt(bent) * math.cos(lat)
    metres = np.deg2rad(1.0) * np.array([east, north])
    words = f"degrees ({who}), laid flat in metres around longitude {middle[0]:.6f}, latitude {middle[1]:.6f}"
    return Laid(lambda at: (at - middle) * metres, words)


def _unmercatored(bounds: tuple[float, float, float, float]) -> Laid:
    middle = np.array([0.5 * (bounds[0] + bounds[2]), 0.5 * (bounds[1] + bounds[3])])
    share = 1 / math.cosh(min(max(middle[1] / RADIUS_M, -5.0), 5.0))
    return Laid(
        lambda at: (at - middle) * share,
        f"Web Mercator, as the file says, made {share:.4f} of its size, which is true at its latitude",
    )
