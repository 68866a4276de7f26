"""Figures of a campaign: consistency against the way driven, ratios with their intervals, maps side by side."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import FixedLocator, FuncFormatter, NullLocator

from .. import palette
from ..text import literal
from . import own_look

SIZE_INCH = (5.2, 3.7)
"""One figure stands alone on a phone, two or three beside each other on a page."""
MARKS = ("o", "s", "^", "D", "v", "P")
"""Of groups in a figure whose colours are those of back ends."""
ROUND = (
    (1.0, 1.2, 1.5, 2.0, 2.5, 3.0, 4.0, 5.0, 6.0, 7.0, 8.0, 9.0),
    (1.0, 1.5, 2.0, 3.0, 5.0, 7.0),
    (1.0, 2.0, 5.0),
    (1.0, 3.0),
    (1.0,),
)
MOST_TICKS = 7


@dataclass(frozen=True)
class Curve:
    """The ANEES of one estimator over the trials of a cell, step by step."""

    name: str
    path_m: Float[np.ndarray, " s"]
    """Mean way driven at each step."""
    anees: Float[np.ndarray, " s"]
    """1 is ideal; NaN where there is none."""
    low: Float[np.ndarray, " s"]
    high: Float[np.ndarray, " s"]
    """The 95 % band of an ideal estimate, which widens as trials end."""


@dataclass(frozen=True)
class Ratio:
    """A ratio with its 95 % interval."""

    name: str
    group: str
    value: float
    low: float
    high: float


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


@own_look()
def anees_figure(title: str, curves: Sequence[Curve]) -> Figure:
    """Draw the ANEES of several estimators over the way driven, with the band of an ideal one."""
    figure, axes = _figure(title)
    for curve in curves:
        order = np.argsort(curve.path_m, kind="stable")
        if curve is curves[0]:
            axes.fill_between(
                curve.path_m[order], curve.low[order], curve.high[order], color=palette.SOLID, label="95 % band", lw=0
            )
        axes.plot(
            curve.path_m[order],
            curve.anees[order],
            color=palette.of_backend(curve.name),
            linewidth=1.3,
            label=curve.name,
        )
    axes.axhline(1.0, color=palette.INK, linewidth=0.7)
    axes.set_yscale("log")
    axes.set_xlabel("mean way driven, m", fontsize=9)
    axes.set_ylabel("ANEES over trials (1 is ideal)", fontsize=9)
    axes.legend(frameon=False, fontsize=8, ncols=2)
    return figure


@own_look()
def ratio_figure(title: str, ratios: Sequence[Ratio], label: str) -> Figure:
    """Draw ratios of back ends with their intervals, a row each: a colour for each back end, a mark for each group."""
    figure, axes = _figure(title, (SIZE_INCH[0], 1.5 + 0.27 * len(ratios)))
    groups = list(dict.fromkeys(ratio.group for ratio in ratios))
    for row, ratio in enumerate(ratios):
        paint, mark = palette.of_backend(ratio.name), MARKS[groups.index(ratio.group) % len(MARKS)]
        axes.plot([ratio.low, ratio.high], [row, row], color=paint, linewidth=2.0)
        axes.plot([ratio.value], [row], mark, color=paint, markersize=5.5, markeredgecolor=palette.PAGE)
    for mark, group in zip(MARKS, groups, strict=False):
        axes.plot([], [], mark, color=palette.INK, markersize=5.5, label=literal(group))
    axes.axvline(1.0, color=palette.INK, linewidth=0.8)
    axes.set_xscale("log")
    axes.xaxis.set_major_locator(FixedLocator(round_ratios(*axes.get_xlim())))
    axes.xaxis.set_minor_locator(NullLocator())
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    names = [ratio.name for ratio in ratios]
    first = [row for row, name in enumerate(names) if row == 0 or names[row - 1] != name]
    axes.set_yticks(first, [literal(names[row]) for row in first], fontsize=8)
    axes.grid(visible=False, axis="y")
    axes.set_ylim(len(ratios) - 0.5, -0.5)
    axes.set_xlabel(label, fontsize=9)
    figure.legend(loc="lower center", ncols=3, frameon=False, fontsize=8)
    figure.subplots_adjust(left=0.3, bottom=0.95 / figure.get_figheight())
    return figure


def round_ratios(low: float, high: float) -> list[float]:
    """Return round numbers between two positive ones, as many as a logarithmic axis has room for the words of.

    Ratios read better as 0.5, 2 and 100 than as powers of ten, and near 1 there is no power of ten to label.
    """
    decades = range(int(np.floor(np.log10(low))), int(np.ceil(np.log10(high))) + 1)
    ticks: list[float] = []
    for steps in ROUND:
        ticks = [s * 10.0**d for d in decades for s in steps if low <= s * 10.0**d <= high]
        if len(ticks) <= MOST_TICKS:
            break
    return ticks


@own_look()
def map_figure(small: SmallMap, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> Figure:
    """Draw one map over the true floor; `low` and `high` are the corners of what is shown, the same for all."""
    size = high - low
    figure, axes = _figure(small.title, (4.0, 0.5 + 3.8 * float(size[1] / size[0])))
    paint_map(axes, small, low, high)
    figure.subplots_adjust(left=0.01, right=0.99, bottom=0.01, top=1.0 - 0.35 / figure.get_figheight())
    return figure


def paint_map(axes: Axes, small: SmallMap, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> None:
    """Paint one map over the true floor into axes that others may share a figure with."""
    for index, ring in enumerate(small.true_floor):
        axes.fill(*ring.T, facecolor=palette.SOLID if index else palette.FLOOR, edgecolor=palette.SOLID, linewidth=3.0)
    axes.plot(*small.path_world.T, color=palette.PATH_ESTIMATED, linewidth=0.7)
    for ends, closed, tentative in zip(small.ends_world, small.is_closed, small.is_tentative, strict=True):
        paint = palette.TENTATIVE if tentative else palette.CLOSED[0] if closed else palette.OPEN
        axes.plot(*ends.T, color=paint, linewidth=1.5, solid_capstyle="round")
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.set_axis_off()


def _figure(title: str, size: tuple[float, float] = SIZE_INCH) -> tuple[Figure, Axes]:
    figure = Figure(figsize=size, dpi=150, facecolor=palette.PAGE)
    FigureCanvasAgg(figure)
    axes = figure.add_subplot()
    axes.set_title(literal(title), fontsize=10, loc="left")
    axes.grid(color=palette.GRID, linewidth=0.6, which="major")
    axes.tick_params(labelsize=8, length=2)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    figure.subplots_adjust(left=0.14, right=0.97, bottom=0.14, top=1.0 - 0.33 / size[1])
    return figure, axes
