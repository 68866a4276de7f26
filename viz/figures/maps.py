"""Pictures of a map, in the style of the paper's figures: a grid of one metre, open ends circled."""

import warnings
from dataclasses import dataclass, field
from io import BytesIO
from textwrap import wrap
from typing import Any, Literal

import matplotlib as mpl
import numpy as np
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import PolyCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Ellipse, Patch, PathPatch
from matplotlib.path import Path

from chainslam.explore.goal import SetAside
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import RobotSpec

from .. import palette
from ..shapes import ellipses
from ..text import literal
from . import own_look
from .map_axes import grid_m, prepare, scale_bar

WALL_M = 0.1
"""Line width of the true walls around the floor, m."""
MARGIN_M = 0.6
ENLARGED = 10.0
"""Magnification of ellipses that would otherwise be invisible."""
LETTER_INCH = 0.072
"""Mean width of a character of the subtitle ..."""
TITLE_LETTER_INCH = 0.115
"""... and of the title."""
LEAST_WIDTH_INCH = 5.0
LARGEST_INCH = 30.0
"""Longer side of the map in the picture of a map of hundreds of metres, 4,500 pixels."""
LEGEND_INCH = 2.3
"""Width of a column of the legend."""


@dataclass(frozen=True)
class Picture:
    """The content of a picture of a map, all in one world frame."""

    map: StochasticMap
    chains: tuple[Chain, ...]
    path_world: Float[np.ndarray, "s 3"]
    """The estimated poses; the first is the start, the last is the robot."""
    title: str
    subtitle: str = ""
    set_aside: tuple[SetAside, ...] = ()
    was_explored: bool = True
    """Whether the robot chose its path; otherwise open ends are not drawn."""
    true_path_world: Float[np.ndarray, "s 3"] | None = None
    corners_world: Float[np.ndarray, "c 2"] = field(default_factory=lambda: np.zeros((0, 2)))
    """Corners with known covariance, m."""
    corner_covs: Float[np.ndarray, "c 2 2"] = field(default_factory=lambda: np.zeros((0, 2, 2)))
    true_floor: tuple[Float[np.ndarray, "_ 2"], ...] = field(default=())
    """Rings of the true floor, the exterior first; empty without ground truth."""
    odometry_path_world: Float[np.ndarray, "s 3"] | None = None
    """Path of the wheel odometry."""
    radius_m: float = RobotSpec.radius_m
    """Radius of the body."""


@own_look()
def draw_map(picture: Picture) -> Figure:
    """Return the picture as a figure of one set of axes."""
    low, high = _extent(picture)
    span = float((high - low).max())
    inch_per_m = min(float(np.clip(9.0 / span, 0.05, 0.9)), LARGEST_INCH / span)
    width, height = np.maximum((high - low) * inch_per_m, (LEAST_WIDTH_INCH, 0.0)).tolist()
    low[0], high[0] = 0.5 * (low[0] + high[0]) + np.array([-0.5, 0.5]) * width / inch_per_m
    figure = Figure(dpi=150, facecolor=palette.PAGE)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    prepare(axes, low, high)
    handles = [
        *_floor(axes, picture, 72.0 * inch_per_m),
        *_walls(axes, picture),
        *_paths(axes, picture),
        *_ends(axes, picture),
        *_corner_ellipses(axes, picture),
        *_robot(axes, picture),
    ]
    title = wrap(picture.title, int(width / TITLE_LETTER_INCH))
    words = wrap(";  ".join(filter(None, (f"grid {grid_m(span):g} m", picture.subtitle))), int(width / LETTER_INCH))
    columns = int(width // LEGEND_INCH)
    below, above = 0.55 + 0.17 * -(-len(handles) // columns), 0.4 + 0.16 * len(words) + 0.24 * len(title)
    whole = np.array([width + 0.8, height + below + above])
    figure.set_size_inches(*whole)
    axes.set_position((0.5 / whole[0], below / whole[1], width / whole[0], height / whole[1]))
    scale_bar(axes, width / inch_per_m, 0.32 / height)
    _write(axes, words, 0.12 / height, size=9, color="#5A5A5A")
    _write(axes, title, (0.22 + 0.16 * len(words)) / height, size=13, weight="bold")
    figure.legend(handles=handles, loc="lower center", ncols=columns, frameon=False, fontsize=8, handlelength=2.2)
    return figure


def _write(axes: Axes, lines: list[str], above: float, **look: Any) -> None:
    axes.text(0.0, 1.0 + above, literal("\n".join(lines)), transform=axes.transAxes, va="bottom", **look)


def png(figure: Figure) -> bytes:
    """Return a figure as a PNG file, the same bytes for the same figure."""
    return saved(figure, "png")


@own_look()
def saved(figure: Figure, kind: Literal["png", "svg", "pdf"]) -> bytes:
    """Return a figure as a file, the same bytes for the same figure; svg and pdf are sharp at any size."""
    buffer = BytesIO()
    unsaid = {"png": "Software", "svg": "Date", "pdf": "CreationDate"}
    with mpl.rc_context({"svg.hashsalt": "chainslam"}), warnings.catch_warnings():
        # Missing glyphs are drawn as boxes.
        warnings.filterwarnings("ignore", message="Glyph .* missing from")
        figure.savefig(buffer, format=kind, metadata={unsaid[kind]: None})
    return buffer.getvalue()


def _extent(picture: Picture) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
    wheels = () if picture.odometry_path_world is None else (picture.odometry_path_world[:, :2],)
    points = [picture.path_world[:, :2], *wheels, picture.map.ends_world.reshape(-1, 2), *picture.true_floor]
    stacked = np.concatenate(points)
    low, high = np.nanmin(stacked, axis=0) - MARGIN_M, np.nanmax(stacked, axis=0) + MARGIN_M
    contours = _corner_contours(picture)[0].reshape(-1, 2)
    # The few corners of which nearly nothing is known do not shrink the map.
    near = contours[np.all((contours > low - MARGIN_M) & (contours < high + MARGIN_M), axis=1)]
    return np.minimum(low, near.min(axis=0, initial=np.inf)), np.maximum(high, near.max(axis=0, initial=-np.inf))


def _floor(axes: Axes, picture: Picture, points_per_m: float) -> list[Patch | Line2D]:
    """Fill the true floor and draw the true walls around it: a wide line, then the floor over its inner half."""
    if not picture.true_floor:
        return []
    vertices = np.concatenate([np.concatenate([ring, ring[:1]]) for ring in picture.true_floor])
    codes = np.concatenate(
        [[Path.MOVETO] + [Path.LINETO] * (len(ring) - 1) + [Path.CLOSEPOLY] for ring in picture.true_floor]
    )
    path = Path(vertices, codes)
    broad = 2.0 * WALL_M * points_per_m
    axes.add_patch(
        PathPatch(path, facecolor="none", edgecolor=palette.SOLID, linewidth=broad, joinstyle="miter", zorder=1.0)
    )
    for ring in picture.true_floor[1:]:
        axes.fill(ring[:, 0], ring[:, 1], color=palette.SOLID, zorder=1.05, linewidth=0)
    axes.add_patch(PathPatch(path, facecolor=palette.FLOOR, edgecolor="none", zorder=1.1))
    return [Patch(color=palette.SOLID, label="true walls")]


def _walls(axes: Axes, picture: Picture) -> list[Patch | Line2D]:
    ends, ids = picture.map.ends_world, picture.map.ids
    handles: list[Patch | Line2D] = []
    closed = 0
    for chain in picture.chains:
        colour = palette.CLOSED[closed % len(palette.CLOSED)] if chain.is_closed else palette.OPEN
        if chain.is_closed:
            handles.append(Line2D([], [], color=colour, linewidth=2.4, label=f"closed chain, {len(chain.walls)} walls"))
        closed += chain.is_closed
        for row in np.searchsorted(ids, chain.walls):
            axes.plot(*ends[row].T, color=colour, linewidth=2.0, solid_capstyle="round", zorder=4)
        corner = chain.corners_world
        axes.plot(*corner.T, "o", markersize=2.6, color=palette.PAGE, markeredgecolor=colour, mew=0.8, zorder=5)
    if len(handles) > 4:
        handles = [Line2D([], [], color=palette.CLOSED[0], linewidth=2.4, label=f"{closed} closed chains")]
    if any(not chain.is_closed for chain in picture.chains):
        handles.append(Line2D([], [], color=palette.OPEN, linewidth=2.4, label="chain with open ends"))
    for row in np.flatnonzero(picture.map.tentative):
        axes.plot(*ends[row].T, color=palette.TENTATIVE, linewidth=1.4, linestyle=(0, (1, 1)), zorder=3.5)
    if picture.map.tentative.any():
        handles.append(Line2D([], [], color=palette.TENTATIVE, linestyle=":", label="tentative wall"))
    for row in np.flatnonzero(picture.map.crooked):
        axes.plot(*ends[row].T, color=palette.CROOKED, linewidth=3.4, solid_capstyle="round", zorder=4.2)
    if picture.map.crooked.any():
        handles.append(Line2D([], [], color=palette.CROOKED, linewidth=3.4, label="wall with lack of fit: unreliable"))
    handles.append(_marker("o", palette.PAGE, palette.INK, 4, "corner"))
    return handles


def _paths(axes: Axes, picture: Picture) -> list[Patch | Line2D]:
    handles: list[Patch | Line2D] = []
    true = picture.true_path_world
    if true is not None:
        axes.plot(true[:, 0], true[:, 1], color=palette.PATH_TRUE, linewidth=2.2, alpha=0.55, zorder=2.4)
        handles.append(Line2D([], [], color=palette.PATH_TRUE, linewidth=2.2, alpha=0.55, label="true path"))
    if (wheels := picture.odometry_path_world) is not None:
        axes.plot(wheels[:, 0], wheels[:, 1], color=palette.PATH_ODOMETRY, linewidth=0.8, zorder=2.3)
        handles.append(Line2D([], [], color=palette.PATH_ODOMETRY, linewidth=0.8, label="odometry alone"))
    path = picture.path_world
    axes.plot(path[:, 0], path[:, 1], color=palette.PATH_ESTIMATED, linewidth=0.9, zorder=2.5)
    handles.append(Line2D([], [], color=palette.PATH_ESTIMATED, linewidth=0.9, label="estimated path"))
    axes.plot(*path[0, :2], "o", markersize=9, color=palette.PAGE, markeredgecolor=palette.INK, mew=1.2, zorder=6)
    axes.plot(*path[0, :2], "+", markersize=8, color=palette.INK, mew=1.2, zorder=6)
    handles.append(_marker(_start_sign(), "none", palette.INK, 9, "start"))
    return handles


def _ends(axes: Axes, picture: Picture) -> list[Patch | Line2D]:
    aside = {(end.wall, end.side) for end in picture.set_aside}
    handles: list[Patch | Line2D] = []
    ends = [end for chain in picture.chains for end in chain.open_ends if picture.was_explored]
    kinds = ((False, palette.ALARM, "open end"), (True, palette.TENTATIVE, "open end, blacklisted"))
    for set_aside, colour, label in kinds:
        places = [end.position_world for end in ends if ((end.wall, end.side) in aside) == set_aside]
        if places:
            axes.plot(*np.array(places).T, "o", markersize=11, color="none", markeredgecolor=colour, mew=1.6, zorder=6)
            handles.append(_marker("o", "none", colour, 9, label))
    return handles


def _corner_ellipses(axes: Axes, picture: Picture) -> list[Patch | Line2D]:
    """Draw 3 sigma ellipses of the corners, enlarged if most would be invisible; the few large ones are pale."""
    if not len(picture.corners_world):
        return []
    contours, radii, times = _corner_contours(picture)
    for chosen, alpha in ((radii > 5.0 * np.median(radii), 0.2), (radii <= 5.0 * np.median(radii), 1.0)):
        axes.add_collection(
            PolyCollection(
                list(contours[chosen]), facecolors="none", edgecolors=palette.INK, linewidths=0.7, alpha=alpha,
                zorder=4.5,
            )
        )  # fmt: skip
    return [_marker("o", "none", palette.INK, 7, "3σ ellipse of a corner" + _times_words(times))]


def _corner_contours(
    picture: Picture,
) -> tuple[Float[np.ndarray, "c 33 2"], Float[np.ndarray, " c"], float]:
    """Return the ellipses of the corners as they are drawn, their radii m, and how much they are enlarged."""
    if not len(picture.corners_world):
        return np.zeros((0, 33, 2)), np.zeros(0), 1.0
    radii = 3.0 * np.sqrt(np.maximum(np.trace(picture.corner_covs, axis1=1, axis2=2), 0.0))
    times = _enlarged(float(np.median(radii)))
    return ellipses(picture.corners_world, picture.corner_covs, times, vertices=33), radii, times


def _enlarged(radius_m: float) -> float:
    return 1.0 if radius_m >= 0.1 else ENLARGED


def _times_words(times: float) -> str:
    return "" if times == 1.0 else f", {times:.0f} times enlarged"


def _robot(axes: Axes, picture: Picture) -> list[Patch | Line2D]:
    """Draw the body and its 3 sigma ellipse, ten times as large if it would be invisible."""
    (x, y, heading), radius_m = picture.path_world[-1], picture.radius_m
    axes.add_patch(
        Circle((x, y), radius_m, facecolor="#FFFFFFCC", edgecolor=palette.PATH_ESTIMATED, linewidth=1.3, zorder=6.5)
    )
    nose = np.array([[x, y], [x + radius_m * np.cos(heading), y + radius_m * np.sin(heading)]])
    axes.plot(*nose.T, color=palette.PATH_ESTIMATED, linewidth=1.3, zorder=6.6)
    variances, vectors = np.linalg.eigh(picture.map.belief.pose_cov[:2, :2])
    radii = 3.0 * np.sqrt(np.maximum(variances, 0.0))
    times = _enlarged(float(radii.max()))
    angle = float(np.rad2deg(np.arctan2(vectors[1, 1], vectors[0, 1])))
    axes.add_patch(
        Ellipse(
            (x, y), 2 * times * radii[1], 2 * times * radii[0], angle=angle,
            facecolor="#D55E0033", edgecolor=palette.ALARM, linewidth=1.0, zorder=6.7,
        )
    )  # fmt: skip
    label = "robot and its 3σ ellipse" + _times_words(times)
    return [_marker("o", "#D55E0033", palette.ALARM, 7, label)]


def _start_sign() -> Path:
    """Return a cross in a circle as a path: as a character it would load the formula engine, a tenth of a second."""
    cross = Path([[-1.0, 0.0], [1.0, 0.0], [0.0, -1.0], [0.0, 1.0]], [Path.MOVETO, Path.LINETO] * 2)
    return Path.make_compound_path(Path.unit_circle(), cross)


def _marker(shape: str | Path, face: str, edge: str, size: int, label: str) -> Line2D:
    return Line2D(
        [], [], linestyle="none", marker=shape, color=face, markeredgecolor=edge, markersize=size, label=label
    )
