"""Figure 11: the robot passes its start again with less uncertainty than it had there."""

import numpy as np
from matplotlib.figure import Figure

from chainslam.slam.geometry.poses import rotation, to_world
from chainslam.viz.figures.panels import paint_uncertain_path, panels

from ..trial import TrialResult
from ..views.timelines import true_rings
from .reproduction import Numbers, Reproduction, Said, Value
from .runs.drives import PAPER, log_of, replayed, there_and_back, to_true, trace_over_start

COMPARED = (PAPER, "full-ekf", "fej-ekf", "invariant-ekf", "graph")
REPASSED_M = 0.5
AWAY_M = 1.5
REPASSING = "trace on repassing the start, over the start's"
LARGEST = "largest trace on the way, over the start's"
SAID: Said = {REPASSING: "below 1", LARGEST: "above that of the repassing"}
EVERY = 12
"""Steps between two ellipses."""


def numbers(seed: int) -> Numbers:
    """Return the results of each back end for one drive there and back."""
    config = there_and_back(seed)
    return {name: _numbers(replayed(config, name)) for name in COMPARED}


def reproduce(seed: int) -> Reproduction:
    """Explore the world of figure 9 from an uncertain start, return to it, and compare the uncertainties."""
    config = there_and_back(seed)
    results = {name: replayed(config, name) for name in COMPARED}
    return Reproduction(
        "Figure 11: uncertainty on coming back to the start",
        SAID,
        numbers(seed),
        _figure(results, seed),
        (f"One drive by {PAPER} in paper-fig9 with --p0 large and --return-to-start, replayed with own gates.",),
    )


def repassed(result: TrialResult) -> int | None:
    """Return the step nearest to the start after the robot has been away; None if it never returned."""
    off = np.hypot(*(log_of(result).true_world - log_of(result).true_world[0])[:, :2].T)
    away = np.flatnonzero(off > AWAY_M)
    back = np.flatnonzero((np.arange(len(off)) > (away[0] if len(away) else len(off))) & (off <= REPASSED_M))
    return int(back[np.argmin(off[back])]) if len(back) else None


def _numbers(result: TrialResult) -> dict[str, Value]:
    log, trace, step = log_of(result), trace_over_start(result), repassed(result)
    sigma = np.sqrt(log.estimated_cov[:, 0, 0] + log.estimated_cov[:, 1, 1])
    error = np.hypot(*(log.estimated_world - log.true_world)[:, :2].T)
    return {
        LARGEST: float(trace.max()),
        REPASSING: None if step is None else float(trace[step]),
        "sigma of the position at the start, cm": 100.0 * float(sigma[0]),
        "on repassing, cm": None if step is None else 100.0 * float(sigma[step]),
        "true error of the position on repassing, cm": None if step is None else 100.0 * float(error[step]),
    }


def _figure(results: dict[str, TrialResult], seed: int) -> Figure:
    title = f"Figure 11, paper-fig9, P0 large, seed {seed}: 3σ ellipses of the position, the start's in orange"
    figure, axes = panels(title, 2, 3, (3.9, 3.1))
    for one, (name, result) in zip(axes, results.items(), strict=False):
        moved = to_true(result)
        turn = rotation(float(moved[2]))
        log, step = log_of(result), repassed(result)
        path = to_world(log.estimated_world[:, :2], moved)
        covs = turn @ log.estimated_cov[:, :2, :2] @ turn.T
        paint_uncertain_path(one, true_rings(result.scenario.world), path, covs, EVERY)
        said = "never repassed" if step is None else f"trace on repassing {trace_over_start(result)[step]:.2g} of P0's"
        one.set_title(f"{name}: {said}", fontsize=8, loc="left")
    for empty in axes[len(results) :]:
        empty.set_axis_off()
    return figure
