"""A run of thirteen steps through a square room."""

from dataclasses import replace

import numpy as np
import pytest

from tests.experiments.by_hand import true_map
from tests.experiments.campaign.scores.thirteen_steps import (
    COVS,
    OFF,
    PATH,
    TRUE,
    N,
)


@pytest.fixture
def made(world, make_map, make_chains):
    """A run of so many steps, with the true map off by the start's error."""
    run = true_map(world, make_map, make_chains)
    columns = {
        name: np.repeat(getattr(run.log, name)[:1], N, axis=0)
        for name in ("ranges_m", "odometry", "odometry_cov", "heard", "heard_cov", "face_of_beam", "open_ends",
                     "tentative", "closed_chains",
                     "set_aside", "seconds", "planning_seconds", "touched", "nis", "nis_dof",
                     "unstated_motion", "is_lost", "wheel_noise_factor", "route_walls", "curved_beams", "own_beams")
    }  # fmt: skip
    log = replace(
        run.log, **columns, time_s=np.arange(float(N)), scan_start_s=np.arange(float(N)) - 0.1,
        estimated_world=TRUE + OFF, estimated_cov=COVS, true_world=TRUE,
        from_start_world=TRUE + 0.5 * OFF, from_start_cov=COVS,
        path_length_m=PATH, lines=np.arange(N), reasons=("",) * N, behaviours=("look",) * N,
    )  # fmt: skip
    return replace(run, log=log, step=replace(run.step, index=N - 1, path_length_m=12.0))


@pytest.fixture
def truth_faces(made):
    return made.votes.truth.faces
