"""What the beams of many scans draw of a wall: the lines through its pieces, and the best place to split it."""

import numpy as np
import pytest

from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.map.extents import WallsConfig
from chainslam.slam.map.landmarks import Landmarks
from chainslam.slam.map.polylines.change_points import ChangePointsConfig
from chainslam.slam.map.polylines.kernels.split_kernels import Fit, best_split, binned, fitted, placed
from chainslam.slam.map.polylines.splits import Split, Splits
from chainslam.slam.map.records import Records
from tests.slam.map.polylines.scenes import WALL


@pytest.mark.parametrize("seed", range(5))
@pytest.mark.parametrize("off_m", [0.0, 0.002])
def test_a_line_through_pieces_is_that_of_a_dense_least_squares(seed, off_m):
    """Far from the anchor; some pieces hold no beam, and each may be off by as much."""
    rng = np.random.default_rng(seed)
    held = np.array([1, 1, 0, 1, 1, 1, 0, 1])
    weight, s = held * rng.uniform(1e4, 1e6, 8), 40.0 + 0.05 * np.arange(8) + rng.uniform(0.0, 0.05, 8)
    z = rng.normal(0.0, 0.01, 8)
    found = fitted(np.stack([weight, weight * s, weight * z, weight * z**2, held]), 1, 8, off_m)
    assert found.beams == np.count_nonzero(held[1:])
    ours = np.flatnonzero(held[1:]) + 1
    sigma = np.sqrt(1.0 / weight[ours] + off_m**2)
    A = np.stack([np.ones(len(ours)), s[ours] - found[0]], axis=-1) / sigma[:, None]
    expected, chi_square, *_ = np.linalg.lstsq(A, z[ours] / sigma, rcond=None)
    cov = np.linalg.inv(A.T @ A)
    assert found[1:3] == pytest.approx(expected, rel=1e-6)
    assert found[3:6] == pytest.approx([cov[0, 0], cov[1, 1], chi_square[0]], rel=1e-6)
    assert cov[0, 1] == pytest.approx(0.0, abs=1e-6 * np.sqrt(cov[0, 0] * cov[1, 1])), "about the middle"


def test_one_piece_has_no_slope_and_none_has_no_line():
    """What beams of one piece are off their middle counts."""
    bins = np.array([[0.0, 4.0], [0.0, 8.0], [0.0, 2.0], [0.0, 3.0], [0.0, 2.0]])
    assert fitted(bins, 0, 2, 0.0) == (2.0, 0.5, 0.0, 0.25, np.inf, 2.0, 2.0)
    assert fitted(bins, 0, 1, 0.0) == (0.0, 0.0, 0.0, np.inf, np.inf, 0.0, 0.0)


@pytest.mark.parametrize("seed", range(10))
def test_the_best_split_is_that_of_all_that_may_be(seed):
    rng = np.random.default_rng(seed)
    weight = rng.choice([0.0, 1.0], 14, p=[0.2, 0.8]) * rng.uniform(1.0, 9.0, 14)
    s, z = np.arange(14) + rng.uniform(0.0, 1.0, 14), rng.normal(0.0, 1.0, 14)
    bins = np.stack([weight, weight * s, weight * z, weight * z**2, weight > 0.0])

    def chi_square(first, last):
        return fitted(bins, first, last, 0.0)[5]

    gains = {}
    for at in range(3, 12):
        start, stop = max(at - 4, 1), min(at + 4, 13)
        if (
            min(at - 1, 13 - at) <= 4
            and min(np.count_nonzero(weight[start:at]), np.count_nonzero(weight[at:stop])) >= 2
        ):
            gains[at] = chi_square(start, stop) - chi_square(start, at) - chi_square(at, stop)
    best = max(gains, key=gains.get)
    assert best_split(bins, 1, 13, 4, 2) == pytest.approx((best, gains[best]))


def test_between_two_long_faces_no_step_is_sought():
    s = np.arange(20) + 0.5
    bins = np.stack([np.ones(20), s, 9.0 * (s > 10.0), 81.0 * (s > 10.0), np.ones(20)])
    assert best_split(bins, 0, 20, 10, 2)[0] == 10
    assert best_split(bins, 0, 20, 6, 2)[0] != 10


@pytest.mark.parametrize("seed", range(5))
def test_beams_lie_where_they_end_whatever_line_was_laid_through_them(seed):
    rng = np.random.default_rng(seed)
    pose, anchor, reference = rng.uniform(-2, 2, 3), rng.uniform(-2, 2, 2), rng.uniform(-3, 3, 2)
    line, foot = np.array([[rng.uniform(-3, 3), 1.5]]), np.array([rng.uniform(-2, 2)])
    aside, across = rng.uniform(-0.5, 0.5, 6), rng.normal(0.0, 0.01, 6)
    ends = placed(line, pose, anchor[None], reference[None], foot, foot[0] + aside, across, np.zeros(6, dtype=np.int64))
    n, t = np.array([np.cos(line[0, 0]), np.sin(line[0, 0])]), np.array([-np.sin(line[0, 0]), np.cos(line[0, 0])])
    robot = (1.5 + across)[:, None] * n + aside[:, None] * t
    c, s = np.cos(pose[2]), np.sin(pose[2])
    world = robot @ np.array([[c, s], [-s, c]]) + pose[:2] - anchor
    n, t = (
        np.array([np.cos(reference[0]), np.sin(reference[0])]),
        np.array([-np.sin(reference[0]), np.cos(reference[0])]),
    )
    np.testing.assert_allclose(ends, [world @ t, world @ n - reference[1]], atol=1e-12)


def test_sums_of_beams_do_not_depend_on_the_order_in_which_they_came():
    rng, records = np.random.default_rng(1), Records()
    splits, row = Splits(WallsConfig(), records), int(records.rows(np.array([WALL]))[0])
    ends, weights = rng.uniform(-1.0, 1.0, (2, 60)), rng.uniform(1.0, 2.0, 60)
    for start in (40, 0, 20):
        splits._add(row, *binned(ends[:, start : start + 20], weights[start : start + 20], 0.05))
    first, bins = binned(ends, weights, 0.05)
    assert records.columns["bins"][0][0] == first
    np.testing.assert_allclose(records.columns["bins"][0][1], bins)


@pytest.mark.parametrize("seed", range(5))
def test_how_far_a_face_is_from_the_wall_is_what_plain_geometry_says(seed):
    """By finite differences of the wall's state; seen from a reference line turned against both."""
    rng, records = np.random.default_rng(seed), Records()
    splits, anchor = Splits(WallsConfig(), records), rng.uniform(-2, 2, 2)
    row = int(records.rows(np.array([WALL]))[0])
    reference, wall = np.array([0.7, 0.01]), np.array([0.7 + rng.normal(0.0, 0.01), rng.normal(0.0, 0.01)])
    records.columns["reference"][row] = reference
    root = rng.normal(0.0, 1.0, (5, 5)) * np.array([0.01, 0.01, 0.002, 0.002, 0.001])[:, None]
    joint, off_line = root @ root.T, np.diag([1e-6, 1e-6])
    belief = Belief(
        np.zeros(3), joint[:3, :3], np.array([WALL]), anchor[None], wall[None],
        lambda ids: Joint(np.zeros(5), joint, anchor[None]),
    )  # fmt: skip
    fit = Fit(rng.uniform(-0.4, 0.4), rng.normal(0.0, 0.01), rng.normal(0.0, 0.02), 1e-6, 1e-4, 1.0, 9.0)
    t, n = np.array([-np.sin(0.7), np.cos(0.7)]), np.array([np.cos(0.7), np.sin(0.7)])
    middle = fit.along * t + (fit.across + reference[1]) * n
    ahead = t + fit.slope * n

    def off(state):
        normal = np.array([np.cos(state[0]), np.sin(state[0])])
        return np.array([np.arctan2(-ahead[0], ahead[1]) - state[0], normal @ middle - state[1]])

    J = np.stack([(off(wall + step) - off(wall - step)) / 2e-6 for step in 1e-6 * np.eye(2)], axis=-1)
    given = joint[3:, 3:] - joint[3:, :3] @ np.linalg.inv(joint[:3, :3]) @ joint[:3, 3:]
    cov = J @ (given + off_line) @ J.T + np.diag([fit.slope_var, fit.across_var])
    expected = off(wall) @ np.linalg.inv(cov) @ off(wall)
    stated = splits._stated(belief, row, lambda _: off_line)
    assert splits._squares(belief, row, [fit], stated) == pytest.approx([expected], rel=0.02)


def test_faces_are_as_long_and_exist_as_surely_as_the_wall_and_may_be_off_as_any():
    landmarks = Landmarks(WallsConfig(), ChangePointsConfig(), 5)
    row = landmarks.records.rows(np.array([WALL]))
    landmarks.records.columns["log_odds"][row] = 7.0
    extents, ids = np.array([[-0.1, 0.2], [-0.3, 0.1]]), np.array([8, 9])
    landmarks.split(Split(WALL, np.zeros((2, 2)), np.zeros((2, 2, 2)), np.zeros((2, 2)), extents), ids)
    rows = landmarks.records.rows(ids)
    np.testing.assert_array_equal(landmarks.records.columns["log_odds"][rows], [7.0, 7.0])
    np.testing.assert_allclose(landmarks.records.columns["longest"][rows], [[0.3, 0.3], [0.4, 0.4]])
    np.testing.assert_array_equal(landmarks.records.columns["extents"][rows], extents)
