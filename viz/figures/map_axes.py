"""The sheet that a map is drawn on: a metric grid with its numbers, and a scale bar."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.patches import Rectangle
from matplotlib.ticker import MultipleLocator

from .. import palette

GRID_ORDER = 1.2
"""Between the true floor and what is drawn on it."""
GRID_M = (1.0, 5.0, 10.0, 50.0, 100.0, 500.0, 1e3, 5e3, 1e4, 5e4, 1e5)
"""Distances of the lines of the grid ..."""
GRID_LINES = 45
"""... of which the first is taken that needs at most so many."""
BARS_M = tuple(digit * 10.0**power for power in range(-2, 6) for digit in (1.0, 2.0, 5.0))
"""Lengths of scale bars."""
BAR_SHARE = 0.25
"""Largest share of a sheet's width that its scale bar takes."""


def prepare(axes: Axes, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> None:
    """Set up axes for the rectangle from `low` to `high`, m, with a grid and its numbers at every second line."""
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_facecolor(palette.PAGE)
    step = grid_m(float((high - low).max()))
    for axis in (axes.xaxis, axes.yaxis):
        axis.set_major_locator(MultipleLocator(step))
        axis.set_major_formatter(lambda value, _: f"{value:.0f}" if round(value / step) % 2 == 0 else "")
    axes.grid(color=palette.GRID, linewidth=0.6)
    for axis in (axes.xaxis, axes.yaxis):
        # Above the floor, below all else; `axisbelow` knows only below the floor and above the paths.
        axis.set_zorder(GRID_ORDER)
    axes.tick_params(length=0, labelsize=7, labelcolor="#8A8A8A")
    for spine in axes.spines.values():
        spine.set_visible(False)


def grid_m(span_m: float) -> float:
    """Return the distance of the grid's lines, m, for a map of this size."""
    return next((step for step in GRID_M if span_m <= GRID_LINES * step), GRID_M[-1])


def bar_m(width_m: float, share: float) -> float:
    """Return the length of a scale bar, m, that takes no more than this share of a width."""
    return max((bar for bar in BARS_M if bar <= share * width_m), default=BARS_M[0])


def scale_bar(axes: Axes, width_m: float, below: float) -> None:
    """Draw a scale bar in four parts at the right end of the sheet, its length beside it.

    `width_m` is what the sheet is wide, `below` how far below it the bar lies, as a share of the sheet's height.
    """
    length = bar_m(width_m, BAR_SHARE)
    edges = 1.0 - length / width_m * np.linspace(1.0, 0.0, 5)
    for part, (start, end) in enumerate(pairwise(edges)):
        axes.add_patch(
            Rectangle(
                (start, -below), end - start, 0.25 * below, transform=axes.transAxes, clip_on=False,
                facecolor=palette.INK if part % 2 == 0 else palette.PAGE, edgecolor=palette.INK, linewidth=0.6,
            )
        )  # fmt: skip
    axes.text(
        edges[0] - 0.01, -0.875 * below, f"{length:g} m", transform=axes.transAxes, ha="right", va="center", fontsize=7,
        color=palette.INK,
    )  # fmt: skip
