"""Small maps, each in a figure of its own or several panels in one, as the paper's figures are reproduced."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure

from .. import palette
from ..shapes import ellipses
from ..text import literal
from . import own_look
from .map_axes import bar_m

MARGIN_M = 0.5
BAR_SHARE = 0.4
"""Largest share of a small map's width that its scale bar takes."""
BAR_ROOM = 0.05
"""Room for the bar below a small map, as a share of its width."""
DASHES: tuple[Any, ...] = ("-", "-", "-", (0, (6, 6)), (0, (2, 10)))
"""Of curves in turn: those that lie on one before them leave it to be seen."""


@dataclass(frozen=True)
class SmallMap:
    """One map beside others, all in the true frame."""

    title: str
    ends_world: Float[np.ndarray, "n 2 2"]
    is_closed: Bool[np.ndarray, " n"]
    """Whether a wall is in a closed chain."""
    is_tentative: Bool[np.ndarray, " n"]
    path_world: Float[np.ndarray, "s 2"]
    true_floor: tuple[Float[np.ndarray, "_ 2"], ...] = field(default=())
    """Rings of the true floor, the exterior first."""


def map_figures(maps: Sequence[SmallMap]) -> list[Figure]:
    """Return a figure for each map of one world, all at one scale."""
    low, high = _extent(maps)
    return [_map_figure(small, low, high) for small in maps]


def _extent(maps: Sequence[SmallMap]) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    points = np.concatenate([p for small in maps for p in (small.ends_world.reshape(-1, 2), *small.true_floor)])
    return points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M


@own_look()
def _map_figure(small: SmallMap, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> Figure:
    """Draw one map over the true floor, with a scale bar; `low` and `high` are the corners of what is shown."""
    low = low - np.array([0.0, BAR_ROOM * (high - low)[0]])
    size = high - low
    figure = Figure(figsize=(3.2, 3.2 * float(size[1] / size[0])), dpi=150, facecolor=palette.PAGE)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    paint_map(axes, small, low, high)
    metres = bar_m(float(size[0]), BAR_SHARE)
    at = low + 0.02 * size[0]
    axes.plot([at[0], at[0] + metres], [at[1], at[1]], color=palette.INK, linewidth=2.5, solid_capstyle="butt")
    axes.text(at[0] + metres + 0.015 * size[0], at[1], f"{metres:g} m", va="center", fontsize=8, color=palette.INK)
    return figure


def paint_map(axes: Axes, small: SmallMap, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> None:
    """Paint one map over the true floor into axes that others may share a figure with."""
    for index, ring in enumerate(small.true_floor):
        axes.fill(*ring.T, facecolor=palette.SOLID if index else palette.FLOOR, edgecolor=palette.SOLID, linewidth=4.0)
    axes.plot(*small.path_world.T, color=palette.PATH_ESTIMATED, linewidth=0.5)
    for ends, closed, tentative in zip(small.ends_world, small.is_closed, small.is_tentative, strict=True):
        paint = palette.TENTATIVE if tentative else palette.CLOSED[0] if closed else palette.OPEN
        axes.plot(*ends.T, color=paint, linewidth=1.7, solid_capstyle="round")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()


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
    low, high = _extent(maps)
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
