"""Errors of a series beside the standard deviations that were stated of them."""

from collections.abc import Sequence

import numpy as np
from jaxtyping import Float
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure

from .. import palette
from . import own_look

IN_95 = 1.959963984540054
"""Half the width of a normal distribution's 95 % interval, in standard deviations."""
SIZE, OF = (6.4, 4.6), 3
"""Of so many errors; with more it is higher."""


@own_look()
def draw_stated_errors(
    time_s: Float[np.ndarray, " n"],
    errors: Float[np.ndarray, "n d"],
    sigmas: Float[np.ndarray, "n d"],
    names: Sequence[str],
    colour: str,
) -> Figure:
    """Return each of d errors against time (s), over the band in which 95 % of them lie if sigma is as stated.

    `names` say what each error is, and its unit. Nothing is drawn across gaps much longer than the others.
    """
    height = SIZE[1] * max(len(names) / OF, 1.0)
    figure = Figure(figsize=(SIZE[0], height), dpi=150, facecolor=palette.PAGE, layout="constrained")
    FigureCanvasAgg(figure)
    steps = np.diff(time_s)
    breaks = np.flatnonzero(steps > 20.0 * np.median(steps)) + 1 if len(steps) else np.zeros(0, dtype=np.int64)
    apart, broken = np.insert(time_s, breaks, np.nan), np.insert(errors, breaks, np.nan, axis=0)
    half = IN_95 * np.insert(sigmas, breaks, np.nan, axis=0)
    rows = np.atleast_1d(figure.subplots(len(names), 1, sharex=True))
    for axes, name, error, width in zip(rows, names, broken.T, half.T, strict=True):
        axes.fill_between(apart, -width, width, color=palette.SOLID, linewidth=0, label="95 % as stated")
        axes.plot(apart, error, color=colour, linewidth=0.9, label="error")
        axes.set_ylabel(name, fontsize=9)
        axes.margins(x=0.01)
        axes.grid(color=palette.GRID, linewidth=0.5)
        axes.set_axisbelow(True)
        axes.tick_params(labelsize=9)
        for side in ("top", "right"):
            axes.spines[side].set_visible(False)
    rows[0].legend(ncols=2, loc="lower left", bbox_to_anchor=(-0.02, 1.0), frameon=False, fontsize=9)
    rows[-1].set_xlabel("time (s)", fontsize=9)
    return figure
