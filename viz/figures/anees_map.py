"""Where consistency ends: the ANEES over a grid of two parameters, one panel for each estimator."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.colors import LogNorm
from matplotlib.figure import Figure

from .. import palette
from ..text import literal
from . import own_look

WORST = 100.0
"""Larger values all have one colour."""
COLOURS = "cividis_r"
"""Distinguishable by lightness alone, also with red-green blindness."""
DARK = 6.0
"""Numbers above this have a dark background."""


@dataclass(frozen=True)
class Field:
    """The ANEES of one estimator on a grid."""

    title: str
    anees: Float[np.ndarray, "r c"]
    """1 is ideal; NaN where it is missing."""
    notes: tuple[tuple[str, ...], ...]
    """A short text below each number."""


@own_look()
def anees_map(
    fields: Sequence[Sequence[Field]], rows: Sequence[str], columns: Sequence[str], labels: tuple[str, str]
) -> Figure:
    """Draw rows of panels over parameters named in words; `labels` names rows and columns."""
    high, wide = len(fields), max(len(line) for line in fields)
    size = max(1.6 + wide * (0.2 + 0.62 * len(columns)), 4.0), max(1.1 + high * (0.45 + 0.5 * len(rows)), 3.0)
    figure = Figure(figsize=size, dpi=150, facecolor=palette.PAGE, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(high, wide, squeeze=False, sharex=True, sharey=True)
    image = None
    for line, axes_line in zip(fields, grid, strict=True):
        for field, axes in zip(line, axes_line, strict=False):
            shown = np.clip(field.anees, 1.0, WORST)
            image = axes.imshow(shown, cmap=COLOURS, norm=LogNorm(1.0, WORST), aspect="auto", origin="lower")
            axes.set_title(literal(field.title), fontsize=9, loc="left")
            axes.set_xticks(range(len(columns)), [literal(name) for name in columns], fontsize=8)
            axes.set_yticks(range(len(rows)), [literal(name) for name in rows], fontsize=8)
            axes.tick_params(length=0)
            for (row, column), value in np.ndenumerate(field.anees):
                ink = palette.PAGE if value > DARK else palette.INK
                words = "–" if np.isnan(value) else f"{value:.2f}" if value < 10 else f"{value:.0f}"
                axes.text(column, row + 0.1, words, ha="center", va="center", fontsize=8, color=ink)
                note = field.notes[row][column]
                axes.text(column, row - 0.28, note, ha="center", va="center", fontsize=5.5, color=ink)
    figure.supylabel(labels[0], fontsize=9)
    figure.supxlabel(labels[1], fontsize=9)
    if image is not None:
        bar = figure.colorbar(image, ax=grid, shrink=0.8, pad=0.01, ticks=[1, 3, 10, 30, 100])
        bar.ax.set_yticklabels(["1", "3", "10", "30", "100 or more"], fontsize=7)
        bar.set_label("pose ANEES (1 is ideal)", fontsize=8)
    return figure
