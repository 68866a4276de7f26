"""Pictures for papers beside the map: paths, the model space, NEES curves, and how often each stretch was driven."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection, PolyCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, MultipleLocator
from scipy.spatial import cKDTree

from .. import palette
from ..shapes import SIGMAS, VAGUE_RAD, ellipses
from ..text import literal
from . import own_look
from .map_axes import scale_bar

STRETCH_M = 0.25
"""A place counts as driven again when the path comes back to within this of it ..."""
AWAY_M = 1.5
"""... after at least so many metres elsewhere."""
PITCH_M = 0.05
"""Points along a path are so far apart at most."""
ENLARGED = 10.0
"""How much ellipses of the model space are enlarged."""
NARROW = (5.0, 3.3)
"""Inches of a figure whose letters are as large as those of the text on a phone."""
WIDEST = 50
"""Letters of a legend's row beyond which it has two names in place of four."""
MOST_SPREADS = 4
"""Curves beyond which pale bands would only cover one another."""
BAR_BELOW = 0.042
"""A plan's scale bar lies so far below it, as a share of its width."""
LEGEND_INCH = 1.1
"""Width of the legend of shades beside a plan."""
GREYS = ("#D8D8D8", "#A8A8A8", "#787878", "#484848", "#101010")
"""Driven once, twice, ..., five times or more, as in the paper's figures 5 and 6."""

Rings = Sequence[Float[np.ndarray, "_ 2"]]


@dataclass(frozen=True)
class NeesCurve:
    """The NEES of the pose of one estimator along its path: of one run, or the median over many."""

    name: str
    path_m: Float[np.ndarray, " p"]
    nees: Float[np.ndarray, " p"]
    band: Float[np.ndarray, "2 p"]
    """Where that of a consistent estimator lies in 95 % of all cases."""
    quartiles: Float[np.ndarray, "2 p"] | None = None
    """Of many runs; drawn as a pale band."""
    colour: str | None = None
    """None takes that of the back end."""


@own_look()
def draw_nees(curves: Sequence[NeesCurve], along: str = "path length (m)", what: str = "NEES of the pose") -> Figure:
    """Return the NEES of estimators on a logarithmic axis, with the band of a consistent one.

    `along` names what it is drawn against, `what` what is drawn. It is as wide as a phone's screen, so that its letters
    can be read there.
    """
    figure, axes = _figure("", NARROW)
    longest = max(curves, key=lambda curve: curve.path_m[-1])
    axes.fill_between(longest.path_m, *longest.band, color=palette.SOLID, linewidth=0, zorder=1)
    for curve in curves:
        colour = curve.colour or palette.of_backend(curve.name)
        if curve.quartiles is not None and len(curves) <= MOST_SPREADS:
            axes.fill_between(curve.path_m, *curve.quartiles, color=colour, alpha=0.15, linewidth=0, zorder=2)
        width = 1.5 if curve.quartiles is not None else 0.9
        axes.plot(curve.path_m, curve.nees, color=colour, linewidth=width, label=literal(curve.name), zorder=3)
    axes.fill_between([], [], [], color=palette.SOLID, linewidth=0, label="95 % band")
    axes.set_yscale("log")
    axes.yaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    _label(axes, along, what)
    return figure


@own_look()
def draw_coverage(
    curves: Mapping[str, tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]],
    colours: Mapping[str, str],
) -> Figure:
    """Return the share of the reachable contour that is mapped against the path length, a curve for each name."""
    figure, axes = _figure("", NARROW)
    for name, (metres, share) in curves.items():
        axes.plot(metres, 100.0 * share, color=colours[name], linewidth=1.5, label=literal(name))
    axes.set_ylim(0.0, 102.0)
    _label(axes, "path length (m)", "contour mapped (%)")
    return figure


def _label(axes: Axes, x: str, y: str) -> None:
    """Name the axes, and the curves above them."""
    axes.margins(x=0.01)
    axes.grid(color=palette.GRID, linewidth=0.5)
    axes.tick_params(labelsize=9)
    axes.set_xlabel(x, fontsize=9)
    axes.set_ylabel(y, fontsize=9)
    look: dict[str, Any] = {"frameon": False, "fontsize": 9, "handlelength": 1.4, "columnspacing": 1.2}
    names = [str(words) for words in axes.get_legend_handles_labels()[1]]
    wide = max((sum(map(len, names[k : k + 4])) for k in range(0, len(names), 4)), default=0) > WIDEST
    axes.legend(ncols=2 if wide else 4, loc="lower left", bbox_to_anchor=(-0.02, 1.0), **look)


@own_look()
def draw_trajectories(
    true_world: Float[np.ndarray, "s 3"] | None,
    estimated_world: Mapping[str, Float[np.ndarray, "_ 3"]],
    rings: Rings,
    title: str,
    wheels_world: Float[np.ndarray, "s 3"] | None = None,
) -> Figure:
    """Return the paths that back ends estimate over the true one and over what the odometry alone say."""
    figure, axes = _plan(rings, title)
    if true_world is not None:
        axes.plot(
            true_world[:, 0], true_world[:, 1], color=palette.PATH_TRUE, linewidth=4.5, alpha=0.6, label="true path"
        )
    if wheels_world is not None:
        axes.plot(
            wheels_world[:, 0], wheels_world[:, 1], ":", color=palette.TENTATIVE, linewidth=1.2, label="odometry alone"
        )
    # Estimates that agree lie on each other: each is drawn narrower than the one below it.
    widths = np.linspace(2.4, 0.8, len(estimated_world)) if len(estimated_world) > 1 else np.ones(1)
    for (backend, path), width in zip(estimated_world.items(), widths, strict=False):
        axes.plot(path[:, 0], path[:, 1], color=palette.of_backend(backend), linewidth=width, label=backend)
    axes.legend(frameon=False, fontsize=8, ncols=5, loc="lower left", bbox_to_anchor=(0.0, 1.0))
    _scale(axes)
    return figure


@own_look()
def draw_model_space(
    lines_world: Float[np.ndarray, "n 2"],
    covs: Float[np.ndarray, "n 2 2"],
    colours: Sequence[str],
    title: str,
) -> Figure:
    """Return the walls as ellipses of three standard deviations in the plane of (alpha rad, r m).

    They are ten times enlarged, unless most would then cross half the picture: so uncertain is a map that begins after
    a blind drive. Walls of a direction less certain than VAGUE_RAD, and than most, whose ellipses are huge, are pale.
    """
    sigma_rad = np.sqrt(covs[:, 0, 0])
    typical = float(np.median(sigma_rad)) if len(sigma_rad) else 0.0
    times = 1.0 if SIGMAS * ENLARGED * typical > 0.5 * np.pi else ENLARGED
    enlarged = "" if times == 1.0 else f", {times:g} times enlarged"
    figure, axes = _figure(f"{title}\n3σ ellipses of the walls{enlarged}", (5.2, 4.6))
    vague = sigma_rad > max(VAGUE_RAD, 2.0 * typical)
    contours = ellipses(lines_world, covs, times, vertices=49)
    for chosen, alpha, width in ((vague, 0.25, 0.6), (~vague, 1.0, 1.0)):
        axes.add_collection(
            PolyCollection(
                list(contours[chosen]), facecolors="none", edgecolors=np.array(colours)[chosen], linewidths=width,
                alpha=alpha, zorder=2 + alpha,
            )
        )  # fmt: skip
    axes.grid(color=palette.GRID, linewidth=0.5)
    axes.scatter(lines_world[:, 0], lines_world[:, 1], s=2.0, c=list(colours), zorder=4)
    axes.set_xlim(-1.05 * np.pi, 1.05 * np.pi)
    axes.set_ylim(lines_world[:, 1].min(initial=0.0) - 1.0, lines_world[:, 1].max(initial=0.0) + 1.0)
    axes.set_xticks(0.5 * np.pi * np.arange(-2, 3), ["-π", "-π/2", "0", "π/2", "π"])
    axes.set_xlabel("direction α, rad")
    axes.set_ylabel("distance r, m")
    return figure


@own_look()
def draw_traversal(path_world: Float[np.ndarray, "s 3"], rings: Rings, title: str) -> Figure:
    """Return the path shaded by how often each stretch was driven, the start in a circle (paper, figures 5 and 6)."""
    figure, axes = _plan(rings, title, LEGEND_INCH)
    places = _dense(path_world[:, :2])
    times = traversals(places)
    pieces = np.stack([places[:-1], places[1:]], axis=1)
    order = np.argsort(times[1:], kind="stable")
    shades = np.minimum(times[1:][order], len(GREYS)) - 1
    lines = LineCollection(
        list(pieces[order]), cmap=ListedColormap(GREYS), linewidths=4.0, capstyle="round", zorder=3,
    )  # fmt: skip
    lines.set_array(shades)
    lines.set_clim(-0.5, len(GREYS) - 0.5)
    axes.add_collection(lines)
    bar = figure.colorbar(lines, ax=axes, ticks=range(len(GREYS)), shrink=0.5, pad=0.02)
    bar.ax.set_yticklabels([*(str(k) for k in range(1, len(GREYS))), f"{len(GREYS)} or more"], fontsize=7)
    bar.set_label("times driven", fontsize=8)
    axes.plot(*places[0], "o", markersize=9, color="none", markeredgecolor=palette.ALARM, mew=1.6, zorder=4)
    _scale(axes)
    return figure


def traversals(places: Float[np.ndarray, "p 2"]) -> Int[np.ndarray, " p"]:
    """Return how often the path comes by each of its places: passes within STRETCH_M, AWAY_M of path apart."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    near = cKDTree(places).query_ball_point(places, STRETCH_M, return_sorted=True)
    return np.array([1 + int(np.count_nonzero(np.diff(along[rows]) > AWAY_M)) for rows in near])


def _dense(places: Float[np.ndarray, "s 2"]) -> Float[np.ndarray, "p 2"]:
    """Return points along a path, at most `PITCH_M` apart."""
    along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(places, axis=0).T))])
    at = np.linspace(0.0, along[-1], max(int(np.ceil(along[-1] / PITCH_M)) + 1, 2))
    return np.stack([np.interp(at, along, places[:, axis]) for axis in (0, 1)], axis=-1)


def _plan(rings: Rings, title: str, beside_inch: float = 0.0) -> tuple[Figure, Axes]:
    """Return axes in metres with the true walls, if any, and room beside them."""
    size = np.ptp(np.concatenate(rings), axis=0) if len(rings) else np.array([1.0, 1.0])
    width, height = size * 7.0 / max(size[0], 1.3 * size[1])
    figure, axes = _figure(title, (float(width) + 0.9 + beside_inch, float(height) + 1.0))
    for ring in rings:
        axes.plot(*np.concatenate([ring, ring[:1]]).T, color=palette.WALL_LINE, linewidth=1.4, zorder=2)
    axes.set_aspect("equal")
    axes.tick_params(length=0)
    axes.xaxis.set_major_locator(MultipleLocator(2.0))
    axes.yaxis.set_major_locator(MultipleLocator(2.0))
    axes.grid(color=palette.GRID, linewidth=0.5)
    return figure, axes


def _scale(axes: Axes) -> None:
    """Name the unit of a plan on which all is drawn, and add a scale bar."""
    (left, right), (low, high) = axes.get_xlim(), axes.get_ylim()
    axes.set_xlim(left, right)
    axes.set_ylim(low, high)
    axes.set_xlabel("x, m", fontsize=8)
    axes.set_ylabel("y, m", fontsize=8)
    scale_bar(axes, right - left, BAR_BELOW * (right - left) / (high - low))


def _figure(title: str, size: tuple[float, float]) -> tuple[Figure, Axes]:
    figure = Figure(figsize=size, dpi=150, facecolor=palette.PAGE, layout="constrained")
    FigureCanvasAgg(figure)
    if title:
        figure.suptitle(literal(title), x=0.02, ha="left", size=10, weight="bold")
    axes = figure.subplots()
    axes.set_axisbelow(True)
    axes.tick_params(labelsize=7)
    for side in ("top", "right"):
        axes.spines[side].set_visible(False)
    return figure, axes
