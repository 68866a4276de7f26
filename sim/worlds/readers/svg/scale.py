"""Metres per unit of an SVG file, and who says so."""

import math
from xml.etree.ElementTree import Element

import numpy as np

from ...drawing import LARGEST_M, SMALLEST_M, WorldError, shorten
from .pieces import Piece
from .shapes import Box

UNITLESS_MAX = 200.0
PHYSICAL = {"mm": 0.001, "cm": 0.01, "in": 0.0254, "pt": 0.0254 / 72, "pc": 0.0254 / 6, "Q": 0.00025}
PIXEL_M = 0.0254 / 96


def stated_scale(root: Element, box: Box | None) -> tuple[float | None, str]:
    """Return metres per user unit where the file states it, and in words who says so."""
    text = root.get("data-metres-per-unit")
    if text is not None:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not 0 < value < math.inf:
            raise WorldError(f"expected data-metres-per-unit above 0, found {shorten(text)}: correct the <svg> element")
        return value, "as the file says"
    sizes = []
    for key, i in (("width", 2), ("height", 3)):
        written = (root.get(key) or "").strip()
        if written.endswith(tuple(PHYSICAL)):
            try:
                metres = float(written.rstrip("mcinptQ")) * next(v for k, v in PHYSICAL.items() if written.endswith(k))
            except ValueError:
                raise WorldError(
                    f"expected {key} as a length such as 900cm, found {shorten(written)}: correct it"
                ) from None
            sizes.append(metres / box[i] if box else PIXEL_M)
    if sizes and math.isfinite(min(sizes)) and min(sizes) > 0:
        return min(sizes), "by the size of the page, drawn 1:1 (--scale METRES says another)"
    return None, "assumed (--scale METRES says another)"


def unitless_scale(dark: list[Piece]) -> float:
    """Return 1 for a drawing that may be in metres; raises WorldError for one that cannot."""
    points = np.concatenate([ring for piece in dark for ring in piece.rings])
    extent = float(np.max(np.ptp(points, axis=0)))
    if not SMALLEST_M <= extent <= min(UNITLESS_MAX, LARGEST_M):
        metres = 0.01 if extent < 1e4 else 0.001
        raise WorldError(
            f"expected a drawing in metres, found {extent:.4g} units wide without a physical size: state the scale,"
            f' such as --scale {metres:g}, or data-metres-per-unit="{metres:g}" in the <svg> element'
        )
    return 1.0
