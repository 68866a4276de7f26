"""The kernels of scan matching against slow truths: each point, each pose, each pair by itself."""

from itertools import pairwise

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.spatial import cKDTree

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.odometry.field_kernels import LikelihoodField, field_of, score
from chainslam.slam.odometry.point_kernels import BESIDE, joined, surface_normals, thinned
from chainslam.slam.odometry.point_to_line import Prior, Surfaces, settle
from chainslam.slam.odometry.search_kernels import Window, correlate, refine
from chainslam.slam.odometry.surface_kernels import NEAREST, normal_equations, sorted_into_buckets, surface_near

seeds = st.integers(0, 2**32)


def cloud(seed: int, largest: int = 40, spread: float = 1.0) -> np.ndarray:
    """Return points, some of them on a wall and some of them twice."""
    rng = np.random.default_rng(seed)
    points = rng.uniform(-spread, spread, (rng.integers(0, largest), 2))
    points[: len(points) // 2, 1] = 0.3 * points[: len(points) // 2, 0]
    return np.concatenate([points, points[: rng.integers(0, 4)]])


def brute_field(points: np.ndarray, at: np.ndarray, kernel: float) -> np.ndarray:
    return np.exp(-0.5 * (np.hypot(*(at[:, None] - points).transpose(2, 0, 1)).min(axis=1) / kernel) ** 2)


def middles_of(field: LikelihoodField) -> np.ndarray:
    rows, columns = np.indices(field.values.shape)
    return field.corner + field.cell_m * np.stack([columns, rows], axis=-1)


def test_the_field_is_the_kernel_of_the_nearest_point() -> None:
    rng = np.random.default_rng(2)
    points = rng.uniform(-1.0, 1.0, (30, 2))
    field = field_of(points, np.zeros(2), 1.5, 0.05, 0.06, 4)
    truth = brute_field(points, middles_of(field).reshape(-1, 2), 0.06).reshape(field.values.shape)
    near = truth > np.exp(-0.5 * 2.3**2)
    np.testing.assert_allclose(field.values[near], truth[near], atol=1e-12)
    assert np.all(field.values <= truth + 1e-12)


@given(seed=seeds, x=st.floats(-3.0, 3.0), y=st.floats(-3.0, 3.0), heading=st.floats(-4.0, 4.0))
@settings(max_examples=100, deadline=None)
def test_a_score_is_the_mean_of_the_field_between_its_cells(seed: int, x: float, y: float, heading: float) -> None:
    points = np.concatenate([cloud(seed), [[0.2, 0.1]]])
    field = field_of(cloud(seed + 1), np.array([0.3, -0.2]), 0.9, 0.05, 0.06, 3)
    likelihoods = []
    for point in to_world(points, np.array([x, y, heading])):
        hats = np.maximum(1.0 - np.abs(middles_of(field) - point) / field.cell_m, 0.0)
        likelihoods.append((field.values * hats.prod(axis=-1)).sum())
    assert score(field, points, x, y, heading) == pytest.approx(np.mean(likelihoods), abs=1e-10)


@given(seed=seeds, sure=st.sampled_from([0.0, 1.0]))
@settings(max_examples=20, deadline=None)
def test_the_search_finds_what_trying_each_pose_by_itself_finds(seed: int, sure: float) -> None:
    rng = np.random.default_rng(seed)
    points = rng.uniform(-1.0, 1.0, (60, 2))
    field = field_of(to_world(points, np.array([0.1, -0.05, 0.07])), np.zeros(2), 1.6, 0.05, 0.06, 6)
    root = rng.normal(0.0, sure, (3, 3))
    window = Window(rng.uniform(-0.05, 0.05, 3), 0.2, 0.12, 0.02, root @ root.T)
    found, likelihood = correlate(field, points, window)
    last = len(field.values) - 1 - field.margin
    best = -np.inf
    for turn in range(-6, 7):
        placed = to_world(points, window.guess + np.array([0.0, 0.0, turn * 0.02]))
        columns, rows = np.clip(np.rint((placed - field.corner) / 0.05).astype(int), field.margin, last).T
        for dy in range(-4, 5):
            for dx in range(-4, 5):
                mean = field.values[rows + dy, columns + dx].mean()
                value = mean - 0.5 * np.sum((root.T @ [dx * 0.05, dy * 0.05, turn * 0.02]) ** 2)
                if value > best + 1e-12:
                    best, expected = value, (dx * 0.05, dy * 0.05, turn * 0.02, mean)
    np.testing.assert_allclose([*(found - window.guess), likelihood], expected, atol=1e-12)


def test_steps_uphill_end_at_the_pose_from_which_the_points_were_seen() -> None:
    points = np.random.default_rng(3).uniform(-1.0, 1.0, (60, 2))
    field = field_of(to_world(points, np.array([0.1, -0.05, 0.07])), np.zeros(2), 1.6, 0.05, 0.06, 6)
    fine, highest = refine(field, points, np.array([0.15, -0.1, 0.05]), 0.02, 0.001)
    np.testing.assert_allclose(fine, [0.1, -0.05, 0.07], atol=0.006)
    assert highest == pytest.approx(score(field, points, *fine.tolist()), abs=1e-12)
    for step in 0.002 * np.concatenate([np.eye(3), -np.eye(3)]):
        assert score(field, points, *(fine + step).tolist()) < highest + 1e-3


@given(seed=seeds, spread=st.sampled_from([0.2, 2.0, 4e7]), cell=st.sampled_from([0.025, 0.3]))
@settings(max_examples=100, deadline=None)
def test_thinning_keeps_the_last_point_of_each_cell_the_latest_first(seed: int, spread: float, cell: float) -> None:
    points = cloud(seed, 200, spread)
    last = {tuple(np.floor(point / cell).tolist()): tuple(point.tolist()) for point in points}
    kept = [tuple(point) for point in thinned(points, cell).tolist()]
    assert set(kept) == set(last.values())
    assert len(kept) == len(last)
    assert kept == [point for point in dict.fromkeys(map(tuple, points[::-1].tolist())) if point in set(kept)]


@given(seed=seeds)
@settings(max_examples=100, deadline=None)
def test_neighbouring_returns_of_one_surface_are_joined_and_others_are_not(seed: int) -> None:
    points = cloud(seed, 20, 0.4)
    expected: list[np.ndarray] = []
    for here, after in pairwise(points):
        apart = np.hypot(*(after - here))
        pieces = int(np.ceil(apart / 0.05)) if apart < 0.3 else 1
        expected += [here + k / pieces * (after - here) for k in range(pieces)]
    expected += list(points[-1:])
    np.testing.assert_allclose(joined(points, 0.05, 0.3), np.reshape(expected, (-1, 2)), atol=1e-12)


@given(seed=seeds)
@settings(max_examples=100, deadline=None)
def test_a_surface_is_told_by_its_neighbours_on_both_sides(seed: int) -> None:
    rng = np.random.default_rng(seed)
    points = np.cumsum(rng.uniform(0.0, 0.05, (30, 2)) + (rng.random((30, 1)) < 0.1), axis=0)
    normals, known = surface_normals(points, 0.5)
    for i in range(30):
        run = points[max(i - BESIDE, 0) : i + BESIDE + 1]
        whole = len(run) == 2 * BESIDE + 1 and bool(np.all(np.hypot(*np.diff(run, axis=0).T) < 0.5))
        assert known[i] == whole
        if whole:
            along = run[BESIDE + 1 :].mean(axis=0) - run[:BESIDE].mean(axis=0)
            np.testing.assert_allclose(normals[i], np.array([-along[1], along[0]]) / np.hypot(*along), atol=1e-9)


def test_of_few_points_no_surface_is_told() -> None:
    for few in range(2 * BESIDE + 1):
        assert not surface_normals(np.zeros((few, 2)), 0.5)[1].any()


@given(seed=seeds, far_m=st.sampled_from([0.3, 5.0]))
@settings(max_examples=200, deadline=None)
def test_the_nearest_points_are_those_of_all_within_reach(seed: int, far_m: float) -> None:
    rng = np.random.default_rng(seed)
    points, place = cloud(seed), rng.uniform(-1.6, 1.6, 2)
    buckets = sorted_into_buckets(points, np.zeros(3), 0.95)
    inside = points[np.all(np.abs(points) < 1.0, axis=1)]
    assert sorted(map(tuple, buckets.points.tolist())) == sorted(map(tuple, inside.tolist()))
    count = min(NEAREST, len(inside))
    if count == 0:
        return
    squared, rows = np.empty(count), np.empty(count, dtype=np.int64)
    nearest = np.sort(np.hypot(*(inside - place).T))[:count]
    if surface_near(buckets, place[0], place[1], far_m, squared, rows):
        np.testing.assert_allclose(np.sqrt(squared), nearest, atol=1e-12)
        np.testing.assert_allclose(np.hypot(*(buckets.points[rows] - place).T), nearest, atol=1e-12)
        assert len(set(rows.tolist())) == count
    else:
        assert nearest[-1] > far_m


@given(seed=seeds)
@settings(max_examples=50, deadline=None)
def test_the_normal_equations_are_those_of_the_weighted_distances(seed: int) -> None:
    """The truth: the jacobian by finite differences, with the nearest points held, of a tree from another library."""
    rng = np.random.default_rng(seed)
    earlier = rng.uniform(-2.0, 2.0, (80, 2))
    points, turned = rng.uniform(-1.5, 1.5, (12, 2)), rng.uniform(-np.pi, np.pi, 12)
    pose, normals = rng.uniform(-0.3, 0.3, 3), np.column_stack([np.cos(turned), np.sin(turned)])
    information, gradient = normal_equations(
        sorted_into_buckets(earlier, pose, 6.0), points, normals, pose, sigma_m=0.03, reach_m=0.2
    )
    surface = earlier[cKDTree(earlier).query(to_world(points, pose), k=NEAREST)[1]].mean(axis=1)
    across = to_world(normals, np.array([0.0, 0.0, pose[2]]))

    def off(moved: np.ndarray) -> np.ndarray:
        return np.vecdot(across, to_world(points, moved) - surface)

    weights = np.exp(-0.5 * (np.hypot(*(surface - to_world(points, pose)).T) / 0.2) ** 2) / 0.03**2
    jacobian = np.column_stack([(off(pose + h) - off(pose - h)) / 2e-6 for h in 1e-6 * np.eye(3)])
    np.testing.assert_allclose(information, (weights[:, None] * jacobian).T @ jacobian, rtol=1e-6, atol=1e-3)
    np.testing.assert_allclose(gradient, -jacobian.T @ (weights * off(pose)), rtol=1e-6, atol=1e-4)


def test_without_earlier_points_the_prior_stays() -> None:
    none = sorted_into_buckets(np.zeros((0, 2)), np.zeros(3), 1.0)
    prior = Prior(np.array([0.1, 0.2, 0.3]), np.eye(3))
    one = Surfaces(np.ones((1, 2)), np.array([[1.0, 0.0]]))
    pose, information = settle(none, one, np.zeros(3), prior, 0.03, 0.06)
    np.testing.assert_allclose(pose, prior.pose, atol=1e-12)
    assert not information.any()
