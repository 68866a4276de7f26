"""Figure 10: the trace of the pose covariance falls below its initial value, and a wall is entered a second time."""

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure

from slam.evaluation.consistency import bound_margins
from viz import palette
from viz.figures.curves import paint_map
from viz.figures.panels import MARGIN_M, paint_curves, paint_ellipses, panels

from ..scenario import TrialConfig
from ..trial import TrialResult
from .reproduction import Numbers, Reproduction, Said, Value
from .runs.doubles import NONE, Double, double_entry, entered, model_space, row_of_wall
from .runs.drives import PAPER, last_map, log_of, replayed, there_and_back, trace_over_start
from .runs.standing import stand

DRIVES = 2
COMPARED = (PAPER, "full-ekf", "fej-ekf", "invariant-ekf", "graph")
LOOKS = 200
LEAST = "least trace over the start's"
SAID: Said = {LEAST: "below 1", "walls left in the map twice": "A and A*, among others"}


def numbers(seed: int) -> Numbers:
    """Return what each back end makes of one drive there and back."""
    config = there_and_back(seed)
    return {name: _numbers(name, [replayed(config, name)], seed) for name in COMPARED}


def reproduce(seed: int) -> Reproduction:
    """Explore the world of figure 9 with an uncertain start and drive back there; count the walls entered twice."""
    configs = [there_and_back(seed + k) for k in range(DRIVES)]
    results = {name: [replayed(config, name) for config in configs] for name in COMPARED}
    pairs = [double_entry(result) for result in results[PAPER]]
    shown = next((k for k, pair in enumerate(pairs) if pair is not None), 0)
    pair = pairs[shown]
    double = None if pair is None else entered(configs[shown], PAPER, pair)
    which = f"seed {configs[shown].seed}"
    return Reproduction(
        "Figure 10: optimistic estimates, and a wall entered twice",
        SAID,
        {name: _numbers(name, found, seed) for name, found in results.items()},
        _figure(configs[shown], {name: found[shown] for name, found in results.items()}, double, which),
        (
            f"{DRIVES} drives in paper-fig9 by {PAPER} with --p0 large and --return-to-start, seeds {seed} to"
            f" {seed + DRIVES - 1}, replayed with each back end's own gate; the picture is of {which}"
            + (", the first with a wall left in the map twice." if double else ": no wall was left in the map twice."),
            "The mapper merges entries that it finds to be one wall, which the paper's did not.",
        ),
    )


def _numbers(name: str, results: list[TrialResult], seed: int) -> dict[str, Value]:
    logs = [log_of(result) for result in results]
    margins = [
        float(bound_margins(log.estimated_world, log.estimated_cov, result.scenario.start_cov).min())
        for log, result in zip(logs, results, strict=True)
    ]
    return {
        LEAST: float(min(trace_over_start(result).min() for result in results)),
        "steps with a trace below the start's, %": 100.0
        * float(np.mean(np.concatenate([trace_over_start(result) for result in results]) < 1.0 - 1e-9)),
        f"standing still, trace after {LOOKS} looks over the start's": float(stand(name, "large", LOOKS, seed)[0][-1]),
        "bound margin, worst": min(margins),
        "walls left in the map twice": sum(result.summary["duplicate_lines"] for result in results),
        "entered twice, then merged": sum(result.summary["merges"] for result in results),
        "pose ANEES (1 is ideal), median": float(np.median([result.summary["pose_anees"] for result in results])),
    }


def _figure(config: TrialConfig, results: dict[str, TrialResult], double: Double | None, which: str) -> Figure:
    figure, (trace, space, place) = panels(f"Figure 10, paper-fig9, P0 large, {which}", 1, 3, (4.0, 3.7))
    log = log_of(results[PAPER])
    curves = {name: trace_over_start(result) for name, result in results.items()}
    paint_curves(trace, log.path_length_m, curves, ("way driven, m", "trace of the pose covariance over the start's"))
    trace.axhline(1.0, color=palette.INK, linewidth=0.8, linestyle="--")
    trace.set_title("(a) no look tells where the world lies: below 1 is wrong", fontsize=8, loc="left")
    small = last_map(results[PAPER], "")
    points = np.concatenate([small.ends_world.reshape(-1, 2), *small.true_floor])
    paint_map(place, small, points.min(axis=0) - MARGIN_M, points.max(axis=0) + MARGIN_M)
    place.set_title(f"(c) the map of {PAPER}", fontsize=8, loc="left")
    if double is None:
        space.set_axis_off()
        return figure
    _paint_space(space, config, double)
    last = results[PAPER].last
    assert last is not None
    rows = last.map.belief.rows(double.ids)
    for row, name, colour in zip(rows, ("A", "A*"), (palette.ALARM, palette.REFUSED), strict=True):
        ends = small.ends_world[row]
        place.plot(*ends.T, color=colour, linewidth=2.6, linestyle="-" if name == "A" else (0, (1.5, 1.0)), zorder=5)
        offset = (-12, 6) if name == "A" else (8, -10)
        place.annotate(name, ends.mean(axis=0), xytext=offset, textcoords="offset points", size=10, weight="bold",
                       color=colour)  # fmt: skip
    place.set_title(f"(c) the map of {PAPER}: A* should be part of A", fontsize=8, loc="left")
    return figure


def _paint_space(axes: Axes, config: TrialConfig, double: Double) -> None:
    """Paint the ellipses of A, and of A* as the paper's filter entered it, at the step when it did."""
    theirs, _ = model_space(config, PAPER, double.step)
    first, second = np.searchsorted(theirs.ids, double.ids)
    like = theirs.ends_world[first]
    for name in COMPARED[1:]:
        space, votes = model_space(config, name, double.step)
        row = row_of_wall(space, votes, double.wall, like)
        if row != NONE:
            paint_ellipses(axes, space.lines_world[[row]], space.covs[[row]], palette.of_backend(name), f"{name}: A")
    paint_ellipses(axes, theirs.lines_world[[first]], theirs.covs[[first]], palette.ALARM, f"{PAPER}: A")
    paint_ellipses(axes, theirs.lines_world[[second]], theirs.covs[[second]], palette.REFUSED, f"{PAPER}: A*")
    result = replayed(config, PAPER)
    face = result.votes.face_of(double.ids[0])
    axes.plot(*result.votes.truth.lines[face], "k*", markersize=9, label="true wall")
    axes.set_xlabel("direction α, rad", fontsize=8)
    axes.set_ylabel("distance r, m", fontsize=8)
    axes.legend(frameon=False, fontsize=7)
    axes.set_title(f"(b) 3σ ellipses in model space at step {double.step + 1}", fontsize=8, loc="left")
