"""The plane of (alpha, r): width of a radian, and axes."""

from dataclasses import dataclass

import numpy as np
import rerun as rr

from ... import palette
from ..colours import packed


@dataclass(frozen=True)
class Plane:
    """All directions alpha, and r from `low` to `high`, m."""

    low: float
    high: float
    width_over_height: float
    """Width over height of the view."""

    @property
    def alpha_units(self) -> float:
        """Width of a radian relative to a metre."""
        return self.width_over_height * (self.high - self.low + 1.0) / (2.0 * np.pi)

    def bounds(self) -> tuple[tuple[float, float], tuple[float, float]]:
        """Return the ranges of a view: along x, and along y downwards."""
        margin = 0.1 * (self.high - self.low + 1.0)
        half = np.pi * self.alpha_units + margin
        return (-half - margin, half), (-self.high - 0.5 - margin, -self.low + 0.5 + 1.5 * margin)

    def axes(self) -> tuple[rr.LineStrips2D, rr.Points2D]:
        """Return the lines alpha = -pi, -pi/2, ... and r = 0, and their names, in (alpha, r)."""
        low, high = self.low - 0.5, self.high + 0.5
        ticks = np.array([-1.0, -0.5, 0.0, 0.5, 1.0]) * np.pi
        step = 5.0 if high - low > 12.0 else 2.0
        levels = step * np.arange(np.ceil((low + 0.1 * (high - low)) / step), np.floor(high / step) + 1.0)
        upright = np.array([[[alpha, low], [alpha, high]] for alpha in ticks])
        level = np.array([[[-np.pi, r], [np.pi, r]] for r in levels])
        names = ["-π", "-π/2", "α = 0", "π/2", "π", *(f"r = {r:.0f} m" for r in levels)]
        places = np.concatenate(
            [np.column_stack([ticks, np.full(5, low - 0.01 * (high - low))]), [[-np.pi - 0.5, r] for r in levels]]
        )
        grey = packed(palette.GRID_STRONG)
        return (
            rr.LineStrips2D(np.concatenate([upright, level]), radii=rr.Radius.ui_points(0.5), colors=grey),
            rr.Points2D(
                places, radii=rr.Radius.ui_points(0.1), colors=packed(palette.PAGE), labels=names, show_labels=True
            ),
        )
