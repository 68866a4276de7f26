"""Shared parts of figures 5 and 6: one world explored by two strategies without noise, shaded by traversals."""

from dataclasses import replace

import numpy as np
from jaxtyping import Float
from matplotlib.figure import Figure

from chainslam.slam.backends import BACKENDS
from chainslam.viz.figures.plots import draw_traversal, traversals

from ...replays.observations import observations_of, ride
from ...replays.recordings import recorded
from ...scenario import TrialConfig
from ...trial import TrialResult
from ...views.timelines import true_rings
from ..reproduction import Numbers, Value
from .drives import PAPER, drive_by_walls, driven, log_of

NEAREST_ROBOT = drive_by_walls("paper-fig5", errorless=True)
NEAREST_START = replace(NEAREST_ROBOT, strategy="nearest-start")
RIDERS = (PAPER, "full-ekf", "invariant-ekf")
"""The graph keeps every one of some thousand poses and would take minutes."""
NOTES = (
    "As in the paper, motion and perception are errorless, so that the seed changes nothing; the models keep their"
    f" stated noise. {PAPER} drives; sigmas are of each back end alone on the same observations, true association.",
)
NEAR_START_M = 1.0
AWAY_M = 1.5


def noisy(config: TrialConfig, seed: int) -> TrialConfig:
    """Return the same drive with noise."""
    return replace(config, errorless=False, seed=seed)


def traversal_numbers(config: TrialConfig) -> Numbers:
    """Return the numbers of the path, which are the same for all back ends, and the uncertainty of each back end."""
    made = driven(config)
    log = log_of(made)
    path: dict[str, Value] = {
        "path, m": made.summary["path_length_m"],
        "contours closed": f"{made.summary['contours_closed']} of {made.summary['contours_reachable']}",
        "passes by the start": passes(log.true_world),
        "share of the path driven before, %": 100.0 * float(np.mean(traversals(log.true_world[:, :2]) > 1)),
    }
    run = recorded(made)
    seen = observations_of(run, perfect_extraction=False)
    ours = {}
    for name in RIDERS:
        covs = ride(
            BACKENDS[name].make(run.start_pose.copy(), run.start_cov.copy(), run.trial.backend_options), seen
        ).estimated_cov
        sigmas = np.sqrt(covs[:, 0, 0] + covs[:, 1, 1])
        ours[name] = path | {
            "largest sigma of the position, cm": 100.0 * float(sigmas.max()),
            "mean sigma of the position, cm": 100.0 * float(sigmas.mean()),
        }
    return ours


def passes(path_world: Float[np.ndarray, "s 3"]) -> int:
    """Return how often the path comes within a metre of its start, counting the start, with 1.5 m in between."""
    away = np.hypot(*(path_world - path_world[0])[:, :2].T)
    count, outside = 1, False
    for distance in away:
        outside = outside or distance > AWAY_M
        if outside and distance <= NEAR_START_M:
            count, outside = count + 1, False
    return count


def traversal_figure(title: str, made: TrialResult) -> Figure:
    """Draw the true path, shaded by how often it was driven."""
    return draw_traversal(log_of(made).true_world, true_rings(made.scenario.world), title)
