"""What a gate leaves of a chi-square is what a simulation says."""

import numpy as np
import pytest

from chainslam.slam.estimation.gates import mean_inside


@pytest.mark.parametrize("gate", [0.9, 0.99])
@pytest.mark.parametrize("dof", [2, 3, 6])
def test_the_mean_behind_a_gate_is_that_of_a_simulation(gate, dof):
    drawn = np.random.default_rng(3).chisquare(dof, 400_000)
    kept = drawn[drawn <= np.quantile(drawn, gate)]
    assert mean_inside(gate, dof) == pytest.approx(kept.mean() / dof, rel=0.01)
