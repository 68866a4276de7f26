"""A run as an animated GIF: the map as known at each moment, over the true floor."""

from collections.abc import Sequence
from dataclasses import dataclass
from io import BytesIO
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from matplotlib.artist import Artist
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.colors import ListedColormap
from matplotlib.figure import Figure
from matplotlib.lines import Line2D
from matplotlib.patches import Circle, Patch, PathPatch
from matplotlib.path import Path
from matplotlib.text import Text
from PIL import Image

from chainslam.slam.map.chains import Chain
from chainslam.slam.robot import RobotSpec

from .. import palette
from ..text import literal
from . import own_look

FRAMES = 90
"""Number of evenly spaced steps that are shown of a longer run."""
FRAME_MS, LAST_MS = 90, 2500
LONGER_SIDE_PX, HEAD_PX, FOOT_PX = 480, 46, 34
LEAST_WIDTH_PX = 420
COLOURS = 48
MARGIN_M = 0.4
DPI = 100


@dataclass(frozen=True)
class Frame:
    """The content of one frame, in the estimate's world frame."""

    step: int
    time_s: float
    """On the robot's clock."""
    path_length_m: float
    path_world: Float[np.ndarray, "s 3"]
    """The estimated poses up to now."""
    ids: tuple[int, ...]
    """Ids of the walls, in increasing order."""
    ends_world: Float[np.ndarray, "n 2 2"]
    chains: tuple[Chain, ...]
    hits_world: Float[np.ndarray, "h 2"]
    """Ends of the beams of the scan."""
    seen: Bool[np.ndarray, "r c"]
    """Floor cells seen free so far; rows are y."""
    seen_origin_world: Float[np.ndarray, "2"]
    cell_m: float
    radius_m: float = RobotSpec.radius_m
    """Radius of the body."""


def shown_steps(count: int) -> list[int]:
    """Return which steps of a run are drawn, always including the last one."""
    return sorted({round(k) for k in np.linspace(0, count - 1, min(count, FRAMES))}) if count else []


@own_look()
def animated(frames: Sequence[Frame], true_floor: Sequence[Float[np.ndarray, "_ 2"]], title: str) -> bytes:
    """Return an animated GIF; raises ValueError for no frames. `true_floor` has rings, the exterior first, m."""
    if not frames:
        raise ValueError("expected a run of at least one step, found none: there is nothing to animate")
    figure, axes, words = _stage(frames, true_floor, title)
    images: list[Image.Image] = []
    for frame in frames:
        drawn = _drawn(axes, frame)
        words.set_text(
            f"step {frame.step + 1}   {frame.path_length_m:.1f} m   {frame.time_s:.0f} s on the robot's clock"
        )
        images.append(_image(figure))
        for artist in drawn:
            artist.remove()
    # With one palette for all frames, a frame only stores what changed.
    colours = _beside(images[len(images) // 2], images[-1]).quantize(COLOURS, Image.Quantize.MAXCOVERAGE)
    small = [image.quantize(palette=colours, dither=Image.Dither.NONE) for image in images]
    buffer = BytesIO()
    durations = [FRAME_MS] * (len(small) - 1) + [LAST_MS]
    small[0].save(
        buffer, "GIF", save_all=True, append_images=small[1:], duration=durations, loop=0, optimize=False, disposal=1
    )
    return buffer.getvalue()


def _words(frame: Frame) -> str:
    return f"step {frame.step + 1}   {frame.path_length_m:.1f} m   {frame.time_s:.0f} s on the robot's clock"


def _stage(
    frames: Sequence[Frame], true_floor: Sequence[Float[np.ndarray, "_ 2"]], title: str
) -> tuple[Figure, Axes, Text]:
    """Return the figure with its static parts, its axes, and the text that changes."""
    last = frames[-1]
    points = np.concatenate([last.path_world[:, :2], last.ends_world.reshape(-1, 2), *true_floor])
    low, high = points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M
    size = np.maximum((high - low) * LONGER_SIDE_PX / float((high - low).max()), (LEAST_WIDTH_PX, 60.0)).round()
    whole = size + np.array([0, HEAD_PX + FOOT_PX])
    figure = Figure(figsize=tuple(whole / DPI), dpi=DPI, facecolor=palette.PAGE)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, FOOT_PX / whole[1], 1.0, size[1] / whole[1]))
    axes.set_xlim(low[0], high[0])
    axes.set_ylim(low[1], high[1])
    axes.set_aspect("equal")
    axes.axis("off")
    if true_floor:
        codes = [[Path.MOVETO] + [Path.LINETO] * (len(ring) - 1) + [Path.CLOSEPOLY] for ring in true_floor]
        vertices = np.concatenate([np.concatenate([ring, ring[:1]]) for ring in true_floor])
        outline = Path(vertices, np.concatenate(codes))
        axes.add_patch(PathPatch(outline, facecolor=palette.FLOOR, edgecolor=palette.SOLID, linewidth=4.0, zorder=1))
    figure.text(0.02, 1.0 - 16 / whole[1], literal(title), size=9, weight="bold", va="center")
    words = figure.text(0.02, 1.0 - 34 / whole[1], "", size=8, color=palette.INK, va="center")
    figure.legend(handles=_legend(), loc="lower center", ncols=5, frameon=False, fontsize=6.5, columnspacing=1.2)
    return figure, axes, words


def _legend() -> list[Patch | Line2D]:
    return [
        Line2D([], [], color=palette.SOLID, linewidth=4, label="true walls"),
        Line2D([], [], color=palette.OPEN, linewidth=2, label="open chain"),
        Line2D([], [], color=palette.CLOSED[0], linewidth=2, label="closed chain"),
        Line2D([], [], color="none", marker="o", markeredgecolor=palette.ALARM, markersize=7, label="open end"),
        Patch(color=palette.SWEPT, label="floor seen"),
    ]


def _drawn(axes: Axes, frame: Frame) -> list[Artist]:
    """Draw what changes from frame to frame, and return it."""
    artists: list[Artist] = []
    if frame.seen.size:
        (rows, columns), (x, y) = frame.seen.shape, frame.seen_origin_world
        extent = (x, x + columns * frame.cell_m, y, y + rows * frame.cell_m)
        seen = np.ma.masked_where(~frame.seen, np.ones(frame.seen.shape))
        colours = ListedColormap([palette.SWEPT])
        limits = axes.get_xlim(), axes.get_ylim()
        look: dict[str, Any] = {"cmap": colours, "interpolation": "nearest", "aspect": "auto", "zorder": 2}
        artists.append(axes.imshow(seen, origin="lower", extent=extent, **look))
        axes.set_aspect("equal")
        axes.set_xlim(limits[0])
        axes.set_ylim(limits[1])
    artists += axes.plot(*frame.path_world[:, :2].T, color=palette.PATH_ESTIMATED, linewidth=0.9, zorder=3)
    artists += axes.plot(*frame.hits_world.T, ".", color=palette.SCAN, markersize=2.2, zorder=5)
    ids = np.array(frame.ids, dtype=np.int64)
    closed = 0
    for chain in frame.chains:
        colour = palette.CLOSED[closed % len(palette.CLOSED)] if chain.is_closed else palette.OPEN
        closed += chain.is_closed
        ends = frame.ends_world[np.searchsorted(ids, chain.walls)]
        artists.append(axes.add_collection(LineCollection(list(ends), colors=colour, linewidths=2.0, zorder=4)))
    open_ends = [end.position_world for chain in frame.chains for end in chain.open_ends]
    if open_ends:
        places = np.array(open_ends).T
        artists += axes.plot(*places, "o", markersize=8, color="none", markeredgecolor=palette.ALARM, mew=1.3, zorder=6)
    (x, y, heading), radius_m = frame.path_world[-1], frame.radius_m
    body = Circle((x, y), radius_m, facecolor=palette.PAGE, edgecolor=palette.PATH_ESTIMATED, linewidth=1.3, zorder=7)
    artists.append(axes.add_patch(body))
    nose = np.array([[x, y], [x + radius_m * np.cos(heading), y + radius_m * np.sin(heading)]])
    artists += axes.plot(*nose.T, color=palette.PATH_ESTIMATED, linewidth=1.3, zorder=8)
    return artists


def _image(figure: Figure) -> Image.Image:
    canvas: Any = figure.canvas
    canvas.draw()
    return Image.fromarray(np.asarray(canvas.buffer_rgba())[..., :3].copy())


def _beside(one: Image.Image, other: Image.Image) -> Image.Image:
    both = Image.new("RGB", (one.width + other.width, one.height))
    both.paste(one, (0, 0))
    both.paste(other, (one.width, 0))
    return both
