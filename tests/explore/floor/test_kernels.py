"""The loops over the grid against brute force: each cell by its own bearing, each pair of cells by its own distance."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import array_shapes, arrays

from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.floor.kernels import HALF_DIAGONAL, squared_distances
from chainslam.slam.geometry.poses import compose
from chainslam.slam.robot import RobotSpec, Scan, ScannerSpec

CELL = FreeSpaceConfig().cell_m


def scan_of(rng, first_rad, turn_rad, beams):
    """Return returns, gaps and blind beams, evenly spaced."""
    ranges = rng.uniform(0.2, 2.5, beams)
    ranges[rng.random(beams) < 0.2] = np.inf
    ranges[rng.random(beams) < 0.1] = np.nan
    return Scan(first_rad + turn_rad / beams * np.arange(beams), ranges, 0.01, 2.2, 0.0)


def change_by_brute_force(grid, pose, body, scan):
    """Return what a scan says of each cell, -1, `hit` or 0, which cells lie within the body, and which are undecided.

    Undecided are cells whose middle lies on a beam, or at the very depth that is seen, as far as rounding tells.
    """
    cells = np.argwhere(np.ones(grid.shape, dtype=bool))
    away = grid.points(cells) - pose[:2]
    distance = np.hypot(*away.T)
    turns = np.mod(np.arctan2(away[:, 1], away[:, 0]) - pose[2] - scan.bearings_rad[0], 2 * np.pi) / scan.step_rad
    beam = np.floor(turns).astype(int)
    shown, k = scan.shown_m, len(scan.bearings_rad)
    depth = np.full(len(cells), -1.0)
    between = beam < (k if scan.is_full_turn else k - 1)
    depth[between] = np.minimum(shown[beam[between] % k], shown[(beam[between] + 1) % k]) - HALF_DIAGONAL * CELL
    from_body = np.hypot(*(grid.points(cells) - body[:2]).T)
    change = -((distance < depth) | (from_body < grid.config.body_m)).astype(int)
    whole = from_body < grid.config.body_m - HALF_DIAGONAL * CELL
    ends = pose[:2] + shown[:, None] * np.stack(
        [np.cos(pose[2] + scan.bearings_rad), np.sin(pose[2] + scan.bearings_rad)], axis=-1
    )
    hits = np.unique(grid.cells(ends[np.isfinite(scan.ranges_m)]) @ [grid.shape[1], 1])
    change[hits], whole[hits] = grid.config.hit, False
    undecided = (np.abs(turns - np.round(turns)) < 1e-7) | (np.abs(distance - depth) < 1e-9)
    return change.reshape(grid.shape), whole.reshape(grid.shape), undecided.reshape(grid.shape)


@pytest.mark.parametrize("seed", range(12))
def test_a_scan_says_of_each_cell_what_the_two_beams_beside_it_say(seed):
    """Full turns and less, coarse and fine, at any pose, on a scanner at the axle or off it, over many scans."""
    rng = np.random.default_rng(seed)
    mounted = np.zeros(3) if seed % 3 else rng.uniform([-0.15, -0.15, -3.0], [0.15, 0.15, 3.0])
    robot = RobotSpec(scanner=ScannerSpec(*mounted.tolist()))
    grid = FreeSpace(FreeSpaceConfig(robot))
    turn, beams = (2 * np.pi if seed % 2 else rng.uniform(1.0, 5.0)), int(rng.choice([5, 40, 180, 700]))
    decided = np.zeros(0)
    for _ in range(6):
        body = rng.uniform([-1.0, -1.0, -7.0], [1.0, 1.0, 7.0])
        scan = scan_of(rng, rng.uniform(-4.0, 4.0), turn, beams)
        grid.integrate(body, Scan(scan.bearings_rad, np.full(beams, np.nan), 0.01, 2.2, 0.0))  # makes room
        before = grid.evidence.astype(int)
        grid.integrate(body, scan)
        change, whole, undecided = change_by_brute_force(grid, compose(body, mounted), body, scan)
        expected = np.clip(before + change, -grid.config.limit, grid.config.limit)
        expected[whole] = np.minimum(expected[whole], -1)
        np.testing.assert_array_equal(grid.evidence[~undecided], expected[~undecided])
        decided = np.append(decided, np.mean(~undecided))
    assert decided.min() > 0.99


@settings(max_examples=60, deadline=None)
@given(
    arrays(bool, array_shapes(min_dims=2, max_dims=2, max_side=14), elements=st.booleans()),
    st.integers(min_value=1, max_value=6),
)
def test_squared_distances_are_the_least_over_all_pairs_of_cells(occupied, reach):
    cells, hit = np.argwhere(np.ones(occupied.shape, dtype=bool)), np.argwhere(occupied)
    squared = ((cells[:, None] - hit) ** 2).sum(axis=2).min(axis=1, initial=(reach + 1) ** 2)
    found = squared_distances(occupied, reach).ravel()
    within = squared <= reach**2
    np.testing.assert_array_equal(found[within], squared[within])
    assert np.all(found[~within] > reach**2)
