"""Several panels in one figure: estimators beside each other, as the paper's figures are reproduced."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from .. import palette
from ..shapes import ellipses
from ..text import literal
from . import own_look
from .curves import SmallMap, paint_map

MARGIN_M = 0.5
DASHES: tuple[Any, ...] = ("-", "-", "-", (0, (6, 6)), (0, (2, 10)))
"""Of curves in turn: those that lie on one before them leave it to be seen."""


@own_look()
def panels(title: str, rows: int, columns: int, size_inch: tuple[float, float]) -> tuple[Figure, list[Axes]]:
    """Return a figure of empty panels, row by row; `size_inch` is that of one panel."""
    size = (columns * size_inch[0], rows * size_inch[1] + 0.35)
    figure = Figure(figsize=size, dpi=150, facecolor=palette.PAGE, layout="constrained")
    FigureCanvasAgg(figure)
    figure.suptitle(literal(title), x=0.01, ha="left", size=11, weight="bold")
    found = list(np.ravel(figure.subplots(rows, columns)))
    for axes in found:
        axes.tick_params(labelsize=7)
        axes.set_axisbelow(True)
        axes.grid(color=palette.GRID, linewidth=0.5)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    return figure, found


@own_look()
def map_panels(title: str, maps: Sequence[SmallMap], columns: int) -> tuple[Figure, list[Axes]]:
    """Draw maps of one world beside each other, all at one scale."""
    points = np.concatenate([p for small in maps for p in (small.ends_world.reshape(-1, 2), *small.true_floor)])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    width = 3.4
    size = (width, width * float((high - low)[1] / (high - low)[0]) + 0.3)
    figure, axes = panels(title, -(-len(maps) // columns), columns, size)
    for one, small in zip(axes, maps, strict=False):
        paint_map(one, small, low, high)
        one.set_title(literal(small.title), fontsize=8, loc="left")
    for empty in axes[len(maps) :]:
        empty.set_axis_off()
    return figure, axes


def paint_curves(
    axes: Axes, x: Float[np.ndarray, " s"], curves: Mapping[str, Float[np.ndarray, " s"]], words: tuple[str, str]
) -> None:
    """Paint a curve for each back end in its colour, on a logarithmic axis; `words` name the two axes."""
    for turn, (name, values) in enumerate(curves.items()):
        dash = DASHES[turn % len(DASHES)]
        axes.plot(x, values, linestyle=dash, color=palette.of_backend(name), linewidth=1.3, label=name)
    axes.set_yscale("log")
    axes.set_xlabel(words[0], fontsize=8)
    axes.set_ylabel(words[1], fontsize=8)
    axes.legend(frameon=False, fontsize=7)


def paint_uncertain_path(
    axes: Axes,
    rings: Sequence[Float[np.ndarray, "_ 2"]],
    path_world: Float[np.ndarray, "s 2"],
    covs: Float[np.ndarray, "s 2 2"],
    every: int,
) -> None:
    """Paint a path with the 3 sigma ellipse of the position at each `every`th place; the first one is the start's."""
    for ring in rings:
        axes.plot(*np.concatenate([ring, ring[:1]]).T, color=palette.WALL_LINE, linewidth=1.2)
    axes.plot(*path_world.T, color=palette.PATH_ESTIMATED, linewidth=0.7)
    outlines = list(ellipses(path_world[::every], covs[::every], 1.0, 33))
    axes.add_collection(PolyCollection(outlines[1:], facecolors="none", edgecolors=palette.NEW, linewidths=0.7))
    axes.add_collection(PolyCollection(outlines[:1], facecolors="none", edgecolors=palette.ALARM, linewidths=1.6))
    axes.plot(*path_world[0], "+", color=palette.ALARM, markersize=9, mew=1.4)
    axes.set_aspect("equal")
    axes.set_axis_off()


def paint_intervals(
    axes: Axes,
    columns: Sequence[str],
    values: Mapping[str, Float[np.ndarray, "c n"]],
    halves: Mapping[str, Float[np.ndarray, "c n"]],
) -> None:
    """Paint n values with their intervals for each back end over each of c columns."""
    for turn, (name, rows) in enumerate(values.items()):
        for column, (ours, half) in enumerate(zip(rows, halves[name], strict=True)):
            at = column + 0.8 * ((turn + (np.arange(len(ours)) + 0.5) / len(ours)) / len(values) - 0.5)
            label = name if column == 0 else None
            axes.errorbar(
                at, ours, half, fmt="o", markersize=2.2, linewidth=1.0, color=palette.of_backend(name), label=label
            )
    axes.axhline(0.0, color=palette.INK, linewidth=0.8)
    axes.set_xticks(range(len(columns)), columns, fontsize=8)
    axes.legend(frameon=False, fontsize=7)


def paint_ellipses(
    axes: Axes, centres: Float[np.ndarray, "n 2"], covs: Float[np.ndarray, "n 2 2"], colour: str, words: str
) -> None:
    """Paint 3 sigma ellipses with their centres in one colour; the first one carries the words of the legend."""
    outlines = list(ellipses(centres, covs, 1.0, 65))
    axes.add_collection(PolyCollection(outlines, facecolors="none", edgecolors=colour, linewidths=1.3))
    axes.plot(*centres.T, "o", markersize=3.0, color=colour, label=words)
    axes.autoscale_view()
