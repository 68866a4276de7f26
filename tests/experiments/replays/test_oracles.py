"""What the truth takes the place of, and what a mapper then need not allow for."""

import numpy as np

from experiments.replays.oracles import of_true_lines
from slam.config import MapperConfig
from slam.map.reliability import Reliability


def test_walls_of_true_lines_lie_on_them_however_short_they_are():
    """A wall of 0.1 m may else be of two faces."""
    ids, extents = np.array([0]), np.array([[0.0, 0.1]])
    told = []
    for config in (MapperConfig(), of_true_lines(MapperConfig())):
        reliability = Reliability(config.walls.reliability)
        reliability._records.rows(ids)  # the wall begins
        told.append(reliability.off_line_cov(ids, extents, np.zeros(1)))
    usual, true = told
    assert usual[0, 0, 0] > 0.0
    np.testing.assert_array_equal(true, np.zeros((1, 2, 2)))
