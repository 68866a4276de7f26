"""Picture of a building as built against as designed: each face of the drawing in the colour of what is said of it."""

from collections.abc import Mapping, Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.collections import LineCollection
from matplotlib.figure import Figure
from matplotlib.lines import Line2D

from .. import palette
from ..text import literal
from . import own_look
from .map_axes import prepare, scale_bar

MARGIN_M = 0.8
EDGE_IN, BAR_IN = 0.25, 0.45
"""Around the drawing, and from it to its scale bar, below the numbers of the axis."""
COLOURS = {
    "within": "#009E73", "unclear": "#56B4E9", "moved": "#D55E00", "missing": "#C8102E", "not seen": "#B8B8B8",
    "extra": "#7B4FA3",
}  # fmt: skip


@own_look()
def draw_check(
    faces: Mapping[str, Sequence[Float[np.ndarray, "2 2"]]],
    notes: Sequence[tuple[Float[np.ndarray, "2"], str]],
    walls: Sequence[Float[np.ndarray, "2 2"]],
    title: str,
) -> Figure:
    """Return a figure of faces by verdict, m, in the frame of the drawing, over the walls of the map as thin lines."""
    points = np.concatenate([np.zeros((0, 2)), *(line for lines in faces.values() for line in lines)])
    low, high = (points.min(axis=0), points.max(axis=0)) if len(points) else (np.zeros(2), np.ones(2))
    low, high = low - MARGIN_M, high + MARGIN_M
    inch = 9.0 / float((high - low).max())
    width, height = ((high - low) * inch).tolist()
    wide, tall = max(width + 2.0 * EDGE_IN, 5.0), height + 1.3
    figure = Figure(figsize=(wide, tall), dpi=150, facecolor=palette.PAGE)
    FigureCanvasAgg(figure)
    axes = figure.add_axes((0.5 * (1.0 - width / wide), 0.9 / tall, width / wide, height / tall))
    prepare(axes, low, high)
    axes.add_collection(LineCollection(walls, colors=palette.INK, linewidths=0.5, zorder=4), autolim=False)
    handles = []
    for verdict, colour in COLOURS.items():
        if lines := faces.get(verdict, ()):
            axes.add_collection(
                LineCollection(lines, colors=colour, linewidths=3.0, alpha=0.8, zorder=3), autolim=False
            )
            handles.append(Line2D([], [], color=colour, linewidth=3.0, label=f"{verdict} ({len(lines)})"))
    for at, words in notes:
        axes.text(
            float(at[0]), float(at[1]), literal(words), fontsize=6.5, ha="center", va="center", color=palette.INK,
            zorder=5, bbox={"facecolor": "white", "edgecolor": "none", "alpha": 0.8, "pad": 0.5},
        )  # fmt: skip
    figure.text(0.02, 1.0 - 0.25 / tall, literal(title), fontsize=10, fontweight="bold", color=palette.INK)
    figure.legend(handles=handles, loc="lower left", ncols=6, fontsize=7, frameon=False)
    scale_bar(axes, float((high - low)[0]), BAR_IN / height)
    return figure
