"""The robot of Julier and Uhlmann (2001): it stands still and observes, and must not learn its place in the world."""

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from chainslam.slam.backends import BACKENDS
from chainslam.viz import palette
from chainslam.viz.figures.panels import paint_curves, panels

from .reproduction import Numbers, Reproduction, Said, Value
from .runs.standing import slope, stand

LOOKS = 300
COMPARED = tuple(name for name in BACKENDS if name != "graph-batch")
LAST = f"trace after {LOOKS} looks over the start's"
BOUND = "least eigenvalue of P - A P0 A' over tr P0"
SAID: Said = {LAST: 1, BOUND: 0}
Curves = dict[str, tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]]


def numbers(seed: int) -> Numbers:
    """Return how certain each back end becomes of its pose."""
    return {name: _numbers(*found) for name, found in _curves("large", seed).items()}


def reproduce(seed: int) -> Reproduction:
    """Observe the same walls from one place again and again, with an uncertain and with a certain start."""
    large, small = (_curves(p0, seed) for p0 in ("large", "small"))
    return Reproduction(
        "A robot that stands still and looks (Julier and Uhlmann 2001)",
        SAID,
        {name: _numbers(*found) for name, found in large.items()},
        _figure({"0.1 m, 2 degrees": large, "0.01 m, 0.1 degree": small}),
        (
            f"{LOOKS} looks at the same walls, P0 large, seed {seed}; no noise of the wheels, for they do not turn.",
            "The column of the paper holds the right values: no scan observes where the world lies.",
        ),
    )


def _curves(p0: str, seed: int) -> Curves:
    return {name: stand(name, p0, LOOKS, seed) for name in COMPARED}


def _numbers(trace: Float[np.ndarray, " n"], bound: Float[np.ndarray, " n"]) -> dict[str, Value]:
    return {LAST: float(trace[-1]), BOUND: float(bound.min()), "slope of the trace, log-log": slope(trace)}


def _figure(curves: dict[str, Curves]) -> Figure:
    figure, axes = panels("A robot that stands still: how sure it becomes of its place", 1, len(curves), (4.6, 3.8))
    for one, (title, found) in zip(axes, curves.items(), strict=True):
        words = "looks", "trace of the pose covariance over the start's"
        paint_curves(one, np.arange(1.0, LOOKS + 1.0), {name: trace for name, (trace, _) in found.items()}, words)
        one.axhline(1.0, color=palette.INK, linewidth=0.8, linestyle="--")
        one.set_xscale("log")
        one.set_title(f"start known to {title}: below 1 is wrong", fontsize=8, loc="left")
    return figure
