"""Figure 10: the trace of the pose covariance falls below its initial value, and a wall gets a duplicate."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from chainslam.slam.evaluation.consistency import bound_margins
from chainslam.viz import palette
from chainslam.viz.figures.panels import MARGIN_M, paint_curves, paint_ellipses, paint_map, panels
from chainslam.viz.shapes import ellipses

from ..scenario import TrialConfig
from .reproduction import Numbers, Reproduction, Said, Value
from .runs.doubles import Double, Search, first_double, watched
from .runs.drives import PAPER, log_of, mark_double, replayed, small_map, there_and_back, trace_over_start
from .runs.standing import stand

COMPARED = (PAPER, "full-ekf", "fej-ekf", "invariant-ekf", "graph")
LOOKS = 200
LEAST, TWICE, AWAY = "least trace over the start's", "duplicate walls", "A* from A, in standard deviations of A"
LEFT, TRIED = "of these left in the last map", "seeds tried until there is a duplicate wall"
SAID: Said = {LEAST: "below 1", TWICE: "A and A*, among others", AWAY: "outside the ellipse of A"}


def numbers(seed: int) -> Numbers:
    """Return the results of each back end for one drive there and back."""
    config = there_and_back(seed)
    return {name: _numbers(name, config) for name in COMPARED}


def reproduce(seed: int) -> Reproduction:
    """Explore the world of figure 9 from an uncertain start and return, until there is a duplicate wall."""
    search = first_double(there_and_back(seed))
    ours = {name: _numbers(name, search.config) for name in COMPARED}
    ours[PAPER] |= {TRIED: search.tried, AWAY: None if search.double is None else search.double.sigmas_away}
    return Reproduction(
        "Figure 10: optimistic estimates, and a duplicate wall",
        SAID,
        ours,
        _figure(search),
        (
            f"A drive in paper-fig9 by --preset paper-method with --p0 large and --return-to-start: {search.words}.",
            "The other back ends map its scans by the same mapper, which merges no walls, each with its own gate.",
        ),
    )


def _numbers(name: str, config: TrialConfig) -> dict[str, Value]:
    drive = watched(config, name)
    result, log = drive.made, log_of(drive.made)
    trace = trace_over_start(result)
    margins = bound_margins(log.estimated_world, log.estimated_cov, result.scenario.start_cov)
    return {
        LEAST: float(trace.min()),
        "steps with a trace below the start's, %": 100.0 * float(np.mean(trace < 1.0 - 1e-9)),
        f"standing still, trace after {LOOKS} looks over the start's": float(
            stand(name, "large", LOOKS, config.seed)[0][-1]
        ),
        "bound margin, worst": float(margins.min()),
        TWICE: len(drive.doubles),
        LEFT: result.summary["duplicate_lines"],
        "pose ANEES (1 is ideal)": result.summary["pose_anees"],
    }


def _figure(search: Search) -> Figure:
    config, double = search.config, search.double
    title = f"Figure 10, paper-fig9, P0 large, seed {config.seed} ({search.tried} tried)"
    figure, (trace, space, place) = panels(title, 1, 3, (4.3, 4.0))
    drive = watched(config)
    curves = {name: trace_over_start(replayed(config, name)) for name in COMPARED}
    words = "path length, m", "trace of the pose covariance over the start's"
    paint_curves(trace, log_of(drive.made).path_length_m, curves, words)
    trace.axhline(1.0, color=palette.INK, linewidth=0.8, linestyle="--")
    trace.set_title("(a) no scan observes the world frame: below 1 is overconfident", fontsize=8, loc="left")
    step = drive.steps[-1 if double is None else double.standing[-1]]
    small = small_map(drive.made, "", step.map, step.chains, step.index + 1)
    points = np.concatenate([small.ends_world.reshape(-1, 2), *small.true_floor])
    paint_map(place, small, points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M)
    if double is None:
        place.set_title(f"(c) the map of {PAPER}: no duplicate wall", fontsize=8, loc="left")
        space.text(0.5, 0.5, f"no A*: {search.tried} seeds tried", ha="center", transform=space.transAxes, size=9)
        return figure
    mark_double(place, small, step.map.belief.rows(double.ids), "A")
    place.set_title(f"(c) the map at step {step.index + 1}: A* should be part of A", fontsize=8, loc="left")
    _paint_space(space, double)
    return figure


def _paint_space(axes: Axes, double: Double) -> None:
    """Draw the ellipses of A and A* at the step at which the paper's filter started A*."""
    first, second = double.space.rows(double.ids)
    middle = double.space.ends_world[first].mean(axis=0)
    theirs = double.space.about(middle)
    paint_ellipses(axes, theirs.lines_world[[first]], theirs.covs[[first]], palette.ALARM, "A in the map")
    paint_ellipses(axes, theirs.lines_world[[second]], theirs.covs[[second]], palette.REFUSED, "A*, observed")
    for row, name, colour, down in ((first, "A", palette.ALARM, 5), (second, "A*", palette.REFUSED, -12)):
        axes.annotate(
            name, theirs.lines_world[row], xytext=(5, down), textcoords="offset points", size=10, weight="bold",
            color=colour,
        )  # fmt: skip
    outlines = ellipses(theirs.lines_world[[first, second]], theirs.covs[[first, second]], 1.0).reshape(-1, 2)
    low, high = outlines.min(axis=0), outlines.max(axis=0)
    axes.set_xlim(low[0] - 0.25 * (high - low)[0], high[0] + 0.25 * (high - low)[0])
    axes.set_ylim(low[1] - 0.25 * (high - low)[1], high[1] + 0.5 * (high - low)[1])
    axes.set_xlabel("direction α, rad", fontsize=8)
    axes.set_ylabel("distance r from the middle of A, m", fontsize=8)
    axes.legend(frameon=False, fontsize=7, loc="upper left")
    title = f"(b) 3σ ellipses in model space at step {double.entered + 1}: A* is {double.sigmas_away:.1f}σ from A"
    axes.set_title(title, fontsize=8, loc="left")
