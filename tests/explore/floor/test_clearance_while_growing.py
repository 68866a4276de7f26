"""Clearances on a grid that grows, against a full distance transform."""

import numpy as np
import pytest

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.slam.robot import Scan
from tests.explore.floor.plain_clearance import full_clearance


@pytest.mark.parametrize("seed", range(4))
def test_clearances_equal_a_full_distance_transform_after_many_updates_and_growths(seed):
    """Random scans on a long random walk: cells are hit, freed again, and the grid grows on all sides."""
    rng = np.random.default_rng(seed)
    grid, bearings = FreeSpace(), -np.pi + np.arange(90) * np.deg2rad(4.0)
    pose, shapes = np.zeros(3), set()
    for _ in range(60):
        pose = pose + rng.normal(0, [0.5, 0.5, 1.0])
        ranges = np.where(rng.random(90) < 0.2, np.inf, rng.uniform(0.25, 1.5, 90))
        grid.integrate(pose, Scan(bearings, ranges, 0.01, 1.6, 0.0))
        shapes.add(grid.shape)
        if rng.random() < 0.4:
            np.testing.assert_allclose(grid.clearance(), full_clearance(grid), atol=1e-6)
    assert len(shapes) > 1
    np.testing.assert_allclose(grid.clearance(), full_clearance(grid), atol=1e-6)
