"""The least-squares optimum of all that a factor graph was told."""

import gtsam
import numpy as np
from jaxtyping import Float

from .config import GraphConfig
from .isam import Estimates
from .record import Record
from .solver import Solver


def optimise(
    config: GraphConfig, record: Record, poses: Float[np.ndarray, "p 3"], lines: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, "n 2"]]:
    """Return all poses and lines at the least-squares optimum (Levenberg-Marquardt), from a first guess.

    Observations are linearised anew at each optimum, at most `rounds` times.
    """
    params = gtsam.LevenbergMarquardtParams()
    params.setRelativeErrorTol(1e-14)
    params.setAbsoluteErrorTol(1e-14)
    for _ in range(config.rounds):
        isam = Solver(config, record, poses, lines).isam
        optimum = Estimates(gtsam.LevenbergMarquardtOptimizer(isam.factors, isam.values, params).optimize())
        before = poses, lines
        poses, lines = optimum.poses(len(poses)), optimum.lines(list(record.lines))
        if np.allclose(poses, before[0], rtol=0, atol=1e-9) and np.allclose(lines, before[1], rtol=0, atol=1e-9):
            break
    return poses, lines


def solve_anew(
    config: GraphConfig, record: Record, poses: Float[np.ndarray, "p 3"], lines: Float[np.ndarray, "n 2"]
) -> Solver:
    """Return the record's graph, solved by damped steps, each of which comes nearer, and linearised there.

    Raises what `Solver.settle` raises.
    """
    solver = Solver(config, record, *optimise(config, record, poses, lines))
    solver.settle()
    return solver
