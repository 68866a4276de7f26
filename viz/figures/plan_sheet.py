"""A dimensioned plan on a sheet of paper: walls, dimension lines, rooms, scale bar and title block, true to scale."""

import re
from collections.abc import Collection, Mapping, Sequence
from dataclasses import dataclass, field
from typing import Literal

import numpy as np
import shapely
from jaxtyping import Float
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.patches import PathPatch, Rectangle
from matplotlib.path import Path
from shapely.geometry.base import BaseGeometry

from .. import palette
from ..text import literal
from . import own_look
from .map_axes import bar_m
from .maps import saved

PAPERS_MM = {"A4": (297.0, 210.0), "A3": (420.0, 297.0)}
"""Width and height; the smallest that holds the plan at the scale at which A3 holds it."""
MARGIN_MM = 10.0
FOOT_MM = 16.0
"""Height of the strip with scale bar and title block."""
SCALES = (20, 25, 50, 75, 100, 150, 200, 250, 300, 400, 500, 750, 1000, 1500, 2000, 5000, 10_000)
LETTER_MM = 1.7
"""Height of the letters of dimensions; rooms have larger ones."""
ROOM_LETTER_MM = 2.4
TICK_MM = 1.0
POINT_MM = 25.4 / 72.0
BOTH, ONE = "#4A4A4A", "#DAD7D0"
THIN = "#8C6D1F"
"""Dimension lines."""
LOOSE = "#9AA7B5"
LAYER = "layer-"
"""Groups of the SVG file that a reader may switch on and off have names that begin so."""


@dataclass(frozen=True)
class DimensionLine:
    """A dimension on the sheet."""

    ends: Float[np.ndarray, "2 2"]
    """Between which points, m."""
    offset_m: float
    """How far to the left of these, seen from the first to the second, the line is drawn."""
    words: str

    @property
    def line(self) -> Float[np.ndarray, "2 2"]:
        """Ends of the drawn line, m."""
        along = (self.ends[1] - self.ends[0]) / max(float(np.hypot(*(self.ends[1] - self.ends[0]))), 1e-9)
        return self.ends + self.offset_m * np.array([-along[1], along[0]])

    @property
    def turn_deg(self) -> float:
        """Rotation of its text: along the line, to be read from below or from the right."""
        x, y = self.ends[1] - self.ends[0]
        turn = float(np.rad2deg(np.arctan2(y, x)))
        return turn - 180.0 if turn > 90.5 else turn + 180.0 if turn <= -89.5 else turn


@dataclass(frozen=True)
class Sheet:
    """What is drawn, m, in the frame of the page: x to the right, y up, the main direction of the walls along both."""

    both: BaseGeometry
    """Walls of which both faces were seen."""
    one: BaseGeometry
    """A band behind faces whose back was not seen."""
    faces: tuple[Float[np.ndarray, "2 2"], ...]
    openings: tuple[Float[np.ndarray, "2 2"], ...]
    lines: tuple[DimensionLine, ...]
    rooms: tuple[tuple[Float[np.ndarray, "2"], str], ...]
    """Labels, and where they stand."""
    loose: Mapping[str, tuple[Float[np.ndarray, "2 2"], ...]] = field(default_factory=dict)
    """Lines by layer: furniture, clutter, open ends."""
    title: str = ""
    notes: tuple[str, ...] = ()
    turn_rad: float = 0.0
    """By which the map was turned counterclockwise onto the page."""

    @property
    def bounds(self) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
        """Lower left and upper right corner of what is drawn."""
        points = [np.reshape(self.one.bounds, (2, 2))] if not self.one.is_empty else []
        points += [*self.faces, *(line.line for line in self.lines)]
        stacked = np.concatenate(points) if points else np.array([[0.0, 0.0], [1.0, 1.0]])
        return stacked.min(axis=0), stacked.max(axis=0)


def scale_of(low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> int:
    """Return the largest usual scale, 1 to this, by which a rectangle (m) fits on A3, upright or not."""
    return next((scale for scale in SCALES if _fits(high - low, scale, "A3")), SCALES[-1])


def _fits(size_m: Float[np.ndarray, "2"], scale: int, paper: str) -> bool:
    width, height = PAPERS_MM[paper] if size_m[0] >= size_m[1] else PAPERS_MM[paper][::-1]
    room = np.array([width, height]) - 2.0 * MARGIN_MM - [0.0, FOOT_MM]
    return bool(np.all(1e3 * size_m / scale <= room))


@own_look()
def draw_sheet(sheet: Sheet, shown: Collection[str]) -> Figure:
    """Return the sheet as a figure in its true size; of the loose layers with those named."""
    low, high = sheet.bounds
    scale = scale_of(low, high)
    paper = next((name for name in PAPERS_MM if _fits(high - low, scale, name)), "A3")
    width, height = PAPERS_MM[paper] if (high - low)[0] >= (high - low)[1] else PAPERS_MM[paper][::-1]
    figure = Figure(figsize=(width / 25.4, height / 25.4), facecolor=palette.PAGE)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    axes.set_axis_off()
    middle = 0.5 * (low + high)
    half = 0.5e-3 * scale * np.array([width, height])
    lift = 0.5e-3 * scale * FOOT_MM
    axes.set_xlim(middle[0] - half[0], middle[0] + half[0])
    axes.set_ylim(middle[1] - half[1] - lift, middle[1] + half[1] - lift)
    _walls(axes, sheet)
    mm = 1e-3 * scale
    for line in sheet.lines:
        _dimension(axes, line, mm)
    for at, words in sheet.rooms:
        axes.text(
            float(at[0]), float(at[1]), literal(words), ha="center", va="center", linespacing=1.3,
            fontsize=ROOM_LETTER_MM / POINT_MM, color=palette.INK,
        )  # fmt: skip
    for name, lines in sheet.loose.items():
        drawn = LineCollection(lines, colors=LOOSE, linewidths=0.6, visible=True)
        drawn.set_gid(LAYER + name)
        if name in shown or shown == {"*"}:
            axes.add_collection(drawn, autolim=False)
    _foot(figure, sheet, f"1:{scale} on {paper}", scale, width, height)
    return figure


def sheet_file(sheet: Sheet, kind: Literal["svg", "pdf", "png"], shown: Collection[str]) -> bytes:
    """Return the sheet as a file. In SVG the loose layers that are not `shown` are there, switched off."""
    if kind != "svg":
        return saved(draw_sheet(sheet, shown), kind)
    text = saved(draw_sheet(sheet, {"*"}), kind).decode()
    for name in sheet.loose:
        hidden = "" if name in shown else ' style="display:none"'
        text = re.sub(f'<g id="{LAYER}{name}">', f'<g id="{LAYER}{name}" class="layer"{hidden}>', text)
    return text.encode()


def _walls(axes: Axes, sheet: Sheet) -> None:
    _area(axes, sheet.one, ONE)
    _area(axes, sheet.both, BOTH)
    axes.add_collection(
        LineCollection(sheet.faces, colors=palette.INK, linewidths=1.0, capstyle="projecting"), autolim=False
    )
    axes.add_collection(
        LineCollection(sheet.openings, colors="#B0B0B0", linewidths=0.4, linestyles="--"), autolim=False
    )


def _area(axes: Axes, shape: BaseGeometry, colour: str) -> None:
    for part in shapely.get_parts(shape):
        if isinstance(part, shapely.Polygon) and not part.is_empty:
            rings = [shapely.get_coordinates(ring) for ring in (part.exterior, *part.interiors)]
            path = Path.make_compound_path(*(Path(ring, closed=True) for ring in rings))
            axes.add_patch(PathPatch(path, facecolor=colour, edgecolor="none"))


def _dimension(axes: Axes, told: DimensionLine, mm: float) -> None:
    """Draw a dimension as architects do: extension lines, a line with oblique ticks, the value above it."""
    line, along = told.line, told.ends[1] - told.ends[0]
    along = along / max(float(np.hypot(*along)), 1e-9)
    left = np.array([-along[1], along[0]]) * (1.0 if told.offset_m >= 0.0 else -1.0)
    parts = [line + np.outer([-1.0, 1.0], along) * 0.8 * TICK_MM * mm]
    for end, at in zip(told.ends, line, strict=True):
        if abs(told.offset_m) > 3.0 * TICK_MM * mm:
            parts.append(np.array([end + left * TICK_MM * mm, at + left * TICK_MM * mm]))
    axes.add_collection(LineCollection(parts, colors=THIN, linewidths=0.35), autolim=False)
    slant = (along + np.array([-along[1], along[0]])) * 0.7 * TICK_MM * mm
    axes.add_collection(
        LineCollection([np.array([at - slant, at + slant]) for at in line], colors=THIN, linewidths=0.8), autolim=False
    )
    turn = np.deg2rad(told.turn_deg)
    above = np.array([-np.sin(turn), np.cos(turn)]) * (0.5 + 0.5 * LETTER_MM) * mm
    x, y = (line.mean(axis=0) + above).tolist()
    axes.text(
        x, y, literal(told.words), rotation=told.turn_deg, rotation_mode="anchor",
        ha="center", va="center", fontsize=LETTER_MM / POINT_MM, color=THIN,
    )  # fmt: skip


def _foot(figure: Figure, sheet: Sheet, said: str, scale: int, width: float, height: float) -> None:
    """Draw the frame of the sheet, the arrow of the map's y axis, the scale bar and the title block."""
    paper = figure.add_axes((0.0, 0.0, 1.0, 1.0))
    paper.set_axis_off()
    paper.set_xlim(0.0, width)
    paper.set_ylim(0.0, height)
    paper.add_patch(Rectangle((5, 5), width - 10, height - 10, fill=False, edgecolor=palette.INK, linewidth=0.7))
    length = bar_m(1e-3 * scale * width, 0.2)
    part = 1e3 * length / scale / 4.0
    for k in range(4):
        paper.add_patch(Rectangle((32 + k * part, 10), part, 1.5, facecolor=palette.INK if k % 2 == 0 else palette.PAGE,
                                  edgecolor=palette.INK, linewidth=0.5))  # fmt: skip
    paper.text(32, 13.0, f"{length:g} m   {said}", fontsize=6, color=palette.INK)
    up = np.array([-np.sin(sheet.turn_rad), np.cos(sheet.turn_rad)])
    foot = np.array([18.0, 13.0])
    paper.annotate(
        "",
        tuple((foot + 6.0 * up).tolist()),
        tuple((foot - 5.0 * up).tolist()),
        arrowprops={"arrowstyle": "-|>", "color": palette.INK, "lw": 0.8},
    )
    x, y = (foot + 8.0 * up).tolist()
    paper.text(x, y, "y", ha="center", va="center", fontsize=6, color=palette.INK)
    words = [sheet.title, *sheet.notes]
    block = min(130.0, 0.5 * width)
    tall = 3.0 + 3.2 * len(words)
    paper.add_patch(
        Rectangle((width - 5 - block, 5), block, tall, facecolor=palette.PAGE, edgecolor=palette.INK, linewidth=0.7)
    )
    for k, line in enumerate(words):
        paper.text(
            width - 3 - block, 5 + tall - 3.4 - 3.2 * k, literal(line), fontsize=6.5 if k == 0 else 5.5,
            color=palette.INK, fontweight="bold" if k == 0 else "normal",
        )  # fmt: skip


def letters_m(words: Sequence[str] | str, scale: int, mm: float = LETTER_MM) -> Float[np.ndarray, "2"]:
    """Return about how wide and how tall a text is, m, at a scale."""
    lines = [words] if isinstance(words, str) else list(words)
    return 1e-3 * scale * mm * np.array([0.62 * max((len(line) for line in lines), default=0), 1.4 * len(lines)])
