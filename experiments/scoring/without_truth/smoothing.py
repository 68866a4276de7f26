"""The smoothed solution of a back end after the run; it does not enter the scores of a run."""

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.estimation.backend import Backend, Joint, Smoother
from chainslam.slam.estimation.mounting import belief_of_body, body_poses
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import ScannerSpec

PairCovs = Callable[[Int[np.ndarray, " m"], Int[np.ndarray, " m"]], Float[np.ndarray, "m 6 6"]]
"""Covariances of pairs of poses by their rows."""


@dataclass(frozen=True)
class Smoothed:
    """The estimate of all poses and lines from all measurements, which was not available at any step."""

    poses_world: Float[np.ndarray, "s 3"]
    """The robot at each step."""
    map: StochasticMap
    joint: Joint
    """The pose at the last step and all lines."""
    pair_covs: PairCovs | None = None
    """Covariances of pairs of poses, each error in its body frame; None if unknown."""


def rows_of_steps(unstated_motion: Bool[np.ndarray, " s"]) -> Int[np.ndarray, " s"]:
    """Return which of a back end's poses, one after each prediction, is that of each step.

    `unstated_motion` tells at which of the steps a second motion was predicted.
    """
    return np.arange(len(unstated_motion)) + np.cumsum(unstated_motion)


def smooth(
    backend: Backend, last: StochasticMap, unstated_motion: Bool[np.ndarray, " s"], scanner: ScannerSpec
) -> Smoothed | None:
    """Let a back end, which follows the scanner, finish; None if it does not smooth or broke off within a step.

    `unstated_motion` tells at which of the steps a second motion was predicted. Every belief before it goes stale.
    """
    try:
        if not isinstance(backend, Smoother):  # Also asks for the belief, which a back end that failed may refuse.
            return None
        poses, rows = body_poses(backend.finish(), scanner), rows_of_steps(unstated_motion)
        belief = belief_of_body(backend.belief, scanner)
        if len(poses) <= rows[-1] or not np.array_equal(belief.ids, last.ids):
            return None
        smoothed = replace(last, belief=belief).told
        return Smoothed(poses[rows], smoothed, smoothed.belief.joint(belief.ids))
    except Exception:  # errors of the back end after a failed run must not cost the results so far
        return None
