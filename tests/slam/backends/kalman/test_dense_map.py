"""How the square of a dense map grows, which of its slots are free, and what it costs to change it."""

import tracemalloc

import numpy as np
import pytest

from chainslam.slam.backends.kalman import kernels
from chainslam.slam.backends.kalman.dense_map import SPARE, DenseMap, cholesky
from chainslam.slam.estimation.models import Initialisation, Linear, Motion

pytestmark = pytest.mark.usefixtures("_unchecked")


def entered(map_, count, rng=None):
    """Enter so many lines, and return their ids."""
    rng = np.random.default_rng(count) if rng is None else rng
    anchors, means, G = (
        rng.uniform(-1, 1, (count, 2)),
        rng.uniform(-1, 1, (count, 2)),
        rng.uniform(-1, 1, (count, 2, 3)),
    )
    return map_.append(Initialisation(anchors, means, G, np.zeros((count, 2, 2))), np.tile(np.eye(2), (count, 1, 1)))


def room(map_):
    """Return how many slots there are, and how many of them are free."""
    return (len(map_._x) - 3) // 2, len(map_._free)


def test_slots_are_added_when_none_is_free_by_sixteen_an_eighth_or_as_many_as_are_needed():
    map_ = DenseMap(np.zeros(3), np.eye(3))
    assert room(map_) == (SPARE, SPARE)
    for count, slots in ((0, 16), (10, 16), (6, 16), (1, 32), (15, 32), (200, 232), (1, 261), (28, 261), (20, 293)):
        entered(map_, count)
        assert room(map_) == (slots, slots - len(map_.ids))
    map_.drop(np.arange(5, 200))
    assert room(map_) == (293, 293 - len(map_.ids))
    assert map_.ids.dtype == np.int64
    entered(map_, 300)
    assert room(map_)[0] == 293 + 300 - (293 - 86)


def test_of_what_comes_and_goes_nothing_is_left_and_no_slot_lost():
    map_, rng = DenseMap(np.zeros(3), np.eye(3)), np.random.default_rng(1)
    for _ in range(50):
        entered(map_, int(rng.integers(0, 9)), rng)
        map_.drop(rng.choice(len(map_.ids), max(len(map_.ids) - 4, 0), replace=False))
        rows = np.arange(len(map_.ids))
        H = rng.standard_normal((4, 3 + 2 * len(rows)))
        map_.condition(Linear(rows, H, rng.standard_normal(4), np.eye(4)))
        map_.move(Motion(map_.pose_world, np.eye(3), np.eye(3)), 1e-2 * np.eye(3))
        free = np.array(map_._free)
        columns = np.concatenate([3 + 2 * free, 4 + 2 * free])
        lower = np.tril(map_._P)
        assert np.all(map_._x[columns] == 0.0)
        assert np.all(lower[columns] == 0.0)
        assert np.all(lower[:, columns] == 0.0)
    assert room(map_) == (SPARE, SPARE - len(map_.ids))


def test_a_pose_of_whole_numbers_becomes_one_of_fractions():
    map_ = DenseMap(np.array([1, 2, 0]), np.eye(3, dtype=np.int64))
    map_.condition(Linear(np.zeros(0, dtype=np.int64), np.eye(3), np.full(3, 0.5), np.eye(3)))
    np.testing.assert_allclose(map_.pose_world, [1.25, 2.25, 0.25])
    np.testing.assert_allclose(map_.pose_cov, 0.5 * np.eye(3))
    assert map_.joint(np.zeros(0, dtype=np.int64)).anchors.shape == (0, 2)


def test_what_is_common_to_all_errors_is_added_in_place():
    """At 500 lines P holds 8 MB."""
    map_, rng = DenseMap(np.zeros(3), np.eye(3)), np.random.default_rng(2)
    entered(map_, 500)
    moves, common = 1e-3 * rng.standard_normal((2, 1003, 3))
    by_pose, by_line = np.eye(3), rng.standard_normal((500, 2, 3))
    map_.follow(moves, common)
    tracemalloc.start()
    map_.follow(moves, common)
    map_.shear(by_pose, by_line)
    peak = tracemalloc.get_traced_memory()[1]
    tracemalloc.stop()
    assert peak < 1e6


def test_parts_of_the_triangle_that_holds_are_those_of_the_whole():
    root, rows = np.random.default_rng(6).normal(size=(11, 11)), np.array([0, 1, 2, 9, 10, 3, 4])
    whole = root + root.T
    held = np.asfortranarray(np.tril(whole))
    np.testing.assert_array_equal(kernels.across(held, rows), whole[rows])
    np.testing.assert_array_equal(kernels.block(held, rows), whole[np.ix_(rows, rows)])
    assert kernels.across(held, rows).flags.c_contiguous


def test_a_covariance_that_is_none_is_told():
    with pytest.raises(np.linalg.LinAlgError, match=r"^expected a positive definite innovation cov.*above zero\?$"):
        cholesky(-np.eye(2))
    assert cholesky(np.zeros((0, 0))).shape == (0, 0)
