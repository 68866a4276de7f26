"""Where a scan is linearised: where the wheels slipped to; never along what no scan can tell."""

import numpy as np

from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.geometry.poses import compose, wrap
from chainslam.slam.robot import Odometry
from tests.slam.backends.conftest import Walls

START, P0 = np.array([0.0, -1.0, 0.3]), np.diag([0.01, 0.01, 0.002]) ** 2
LOST = np.diag([0.05, 0.05, 0.06]) ** 2
"""What a metre without a wall in sight costs: 5 cm and 3.4 degrees."""
SLIPS = (0.01, 0.005, 0.03)
"""Of each step: 1.7 degrees."""
SEEDS = 20


def heading_nees(walls, relinearise, seed):
    """Return the NEES of the heading against the first wall, after a blind metre and 60 looks at new walls."""
    rng, backend = np.random.default_rng(seed), FullEkf(START, P0, EkfConfig(relinearise=relinearise))
    known = backend.grow(*walls.look(START, np.arange(3), rng))
    backend.predict(Odometry(np.zeros(3), LOST))
    lost = compose(START, np.sqrt(np.diag(LOST)) * rng.standard_normal(3))
    *_, true = Walls(walls.lines[3:], walls.points[3:], walls.sigmas).tour(backend, lost, rng, 60, seen=3, sigmas=SLIPS)
    joint = backend.belief.joint(known[:1])
    error = wrap(joint.mean[2] - joint.mean[3] - (true[2] - walls.lines[0, 0]))
    return error**2 / (np.array([1.0, -1.0]) @ joint.cov[2:4, 2:4] @ np.array([1.0, -1.0]))


def test_a_turn_of_all_that_is_new_is_taken_for_measured_no_more_than_without_linearising_anew(make_walls):
    """A Jacobian taken where the whole update leads made it 2.4 times the plain filter's."""
    nees = {
        anew: np.mean([heading_nees(make_walls(16, seed=seed), anew, seed) for seed in range(SEEDS)])
        for anew in (True, False)
    }
    print(f"NEES of the heading against an old wall: {nees[True]:.1f}, without linearising anew {nees[False]:.1f}")
    assert nees[True] < 1.25 * nees[False]
