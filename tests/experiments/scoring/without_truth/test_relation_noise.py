"""Uncertainty of relations: by finite differences, by draws, and by relations whose error is known."""

from itertools import product

import numpy as np
import pytest

from chainslam.experiments.scoring.without_truth.relation_noise import (
    adjoint_of_inverse,
    body_covs,
    relation_covs,
    sigmas_of_path,
    sigmas_of_relations,
    triangles,
)
from chainslam.experiments.scoring.without_truth.relations import Relations, between
from chainslam.slam.geometry.poses import compose, inverse

STEP = 1e-6


def composed(first, second):
    return np.array([compose(a, b) for a, b in zip(first, second, strict=True)])


def a_path(rng, count):
    return np.column_stack([rng.uniform(-10, 10, (count, 2)), rng.uniform(-3, 3, count)])


def test_a_motion_before_is_the_adjoint_of_it_after():
    motions = a_path(np.random.default_rng(1), 5)
    for motion, A in zip(motions, adjoint_of_inverse(motions), strict=True):
        moved = [compose(inverse(motion), compose(STEP * axis, motion)) for axis in np.eye(3)]
        np.testing.assert_allclose(A, np.array(moved).T / STEP, atol=1e-5)


def test_the_covariance_of_a_relation_is_that_of_draws_of_both_poses():
    rng = np.random.default_rng(2)
    first, second = a_path(rng, 1), a_path(rng, 1)
    root = 1e-3 * rng.standard_normal((6, 6))
    draws = rng.standard_normal((40000, 6)) @ root.T
    true = between(first, second)
    many = [np.broadcast_to(pose, (len(draws), 3)) for pose in (first, second, true)]
    left = between(many[2], between(composed(many[0], draws[:, :3]), composed(many[1], draws[:, 3:])))
    found = relation_covs(true, (root @ root.T)[None])[0]
    sigma = np.sqrt(np.diag(found))
    np.testing.assert_allclose(np.cov(left.T) / np.outer(sigma, sigma), found / np.outer(sigma, sigma), atol=0.03)


def test_covariances_of_the_world_frame_are_turned_into_that_of_the_pose():
    pose, along = np.array([5.0, -3.0, np.pi / 3]), np.array([0.5, np.sqrt(0.75), 0.0])
    (found,) = body_covs(pose[None], (np.outer(along, along) + np.diag([0, 0, 4.0]))[None])
    np.testing.assert_allclose(found, np.diag([1.0, 0.0, 4.0]), atol=1e-12)


def measured(rng, path, pairs, sigmas):
    """Return relations between the poses of a path, each with an error of its own."""
    first, second = np.array(pairs).T
    noise = rng.standard_normal((len(pairs), 3)) * np.array([sigmas[0], sigmas[0], sigmas[1]])
    return Relations(1.0 * first, 1.0 * second, composed(between(path[first], path[second]), noise))


def test_triangles_are_those_that_trying_all_finds():
    rng = np.random.default_rng(3)
    pairs = sorted({(int(a), int(b)) for a, b in rng.integers(0, 12, (60, 2)) if a != b})
    relations = Relations(np.array(pairs)[:, 0] + 2e-4, 1.0 * np.array(pairs)[:, 1], np.zeros((len(pairs), 3)))
    brute = {
        (i, j, k)
        for i, j, k in product(range(len(pairs)), repeat=3)
        if pairs[i][1] == pairs[j][0] and pairs[k] == (pairs[i][0], pairs[j][1])
    }
    assert {tuple(row) for row in triangles(relations).tolist()} == brute
    assert brute


def test_what_triangles_do_not_close_tells_the_error_of_relations_and_mistakes_are_left_out():
    rng = np.random.default_rng(4)
    path = a_path(rng, 300)
    pairs = [pair for k in range(0, 298, 2) for pair in ((k, k + 1), (k + 1, k + 2), (k, k + 2))]
    relations = measured(rng, path, pairs, (0.01, 0.005))
    relations.motions[[7, 100, 200], :2] += 1.0
    found = sigmas_of_relations(relations)
    assert found.translation_m == pytest.approx(0.01, rel=0.15)
    assert found.rotation_rad == pytest.approx(0.005, rel=0.15)
    assert 3 <= found.mistaken <= 8
    assert found.told_by + found.mistaken == 149


def test_relations_that_close_no_triangle_tell_nothing_of_their_error():
    rng = np.random.default_rng(5)
    assert sigmas_of_relations(measured(rng, a_path(rng, 9), [(0, 1), (1, 2), (3, 4)], (0.1, 0.1))) is None
    assert sigmas_of_path(np.zeros((0, 3)), np.zeros((0, 3)), None) is None


def test_relations_tell_the_error_of_the_poses_of_a_path_beyond_their_own():
    rng = np.random.default_rng(6)
    path = a_path(rng, 400)
    wrong = composed(path, rng.standard_normal((400, 3)) * np.array([0.03, 0.03, 0.01]))
    pairs = [(k, k + 200) for k in range(200)] + [(k, 399 - k) for k in range(100)]
    pairs += [pair for k in range(0, 298, 2) for pair in ((k, k + 1), (k + 1, k + 2), (k, k + 2))]
    relations = measured(rng, path, pairs, (0.02, 0.004))
    motions = between(*(wrong[times.astype(int)] for times in (relations.first_s, relations.second_s)))
    own = sigmas_of_relations(relations)
    found = sigmas_of_path(motions, between(relations.motions, motions), own)
    assert found.translation_m == pytest.approx(0.03, rel=0.15)
    assert found.rotation_rad == pytest.approx(0.01, rel=0.15)
