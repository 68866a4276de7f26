"""Poses against 3 x 3 matrices: the axioms of the group, and what it does to points."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.integrate import solve_ivp

from chainslam.slam.geometry.poses import (
    J,
    arc,
    compose,
    inverse,
    rotation,
    to_robot,
    to_world,
    turned,
    wrap,
    wrap_positive,
)

metres = st.floats(-50.0, 50.0)
angles = st.floats(-20.0, 20.0)
poses = st.builds(lambda x, y, turn: np.array([x, y, turn]), metres, metres, angles)
few = settings(max_examples=25, deadline=None, derandomize=True)
NOTHING = np.zeros(3)


def assert_same_pose(one, other, atol=1e-10):
    np.testing.assert_allclose(one[:2], other[:2], atol=atol)
    np.testing.assert_allclose(np.sin(one[2]), np.sin(other[2]), atol=atol)
    np.testing.assert_allclose(np.cos(one[2]), np.cos(other[2]), atol=atol)


def matrix(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


@pytest.mark.parametrize("shape", [(7, 2), (7, 3, 2), (0, 2)])
def test_points_are_turned_each_by_its_own_angle(shape):
    rng = np.random.default_rng(4)
    points, by = rng.normal(0.0, 3.0, shape), rng.uniform(-7.0, 7.0, shape[0])
    for k, found in enumerate(turned(points, by)):
        np.testing.assert_allclose(found, to_world(points[k], np.array([0.0, 0.0, by[k]])), atol=1e-12)


@few
@given(poses, poses, poses)
def test_composition_is_associative(a, b, c):
    assert_same_pose(compose(compose(a, b), c), compose(a, compose(b, c)))


@few
@given(poses)
def test_nothing_is_neutral_and_the_inverse_undoes(a):
    assert_same_pose(compose(a, NOTHING), a)
    assert_same_pose(compose(NOTHING, a), a)
    assert_same_pose(compose(a, inverse(a)), NOTHING)
    assert_same_pose(compose(inverse(a), a), NOTHING)


@few
@given(poses, poses)
def test_composition_multiplies_matrices(a, b):
    np.testing.assert_allclose(matrix(compose(a, b)), matrix(a) @ matrix(b), atol=1e-10)


@few
@given(angles)
def test_wrapped_angles_are_the_same_directions_within_half_a_turn(angle):
    wrapped = wrap(angle)
    assert -np.pi <= wrapped < np.pi
    np.testing.assert_allclose([np.cos(wrapped), np.sin(wrapped)], [np.cos(angle), np.sin(angle)], atol=1e-12)
    np.testing.assert_allclose(wrap(wrapped), wrapped, atol=1e-12)


@pytest.mark.parametrize("precision", [np.float32, np.float64])
def test_positive_angles_are_those_of_mod_to_the_last_bit(precision):
    turns = np.array([0.0, -0.0, 2 * np.pi, -2 * np.pi, 4 * np.pi, 1e-30, -1e-30])
    angles = np.concatenate([np.random.default_rng(0).uniform(-20.0, 20.0, 10_000), turns]).astype(precision)
    found = wrap_positive(angles)
    assert found.dtype == precision
    np.testing.assert_array_equal(found, np.mod(angles, precision(2 * np.pi)))


@few
@given(poses, st.integers(0, 2**31))
def test_points_go_to_the_world_by_the_matrix_and_come_back(pose, seed):
    points = np.random.default_rng(seed).normal(size=(4, 3, 2)) * 10
    world = to_world(points, pose)
    ones = np.concatenate([points, np.ones((4, 3, 1))], axis=-1)
    np.testing.assert_allclose(world, (ones @ matrix(pose).T)[..., :2], atol=1e-10)
    np.testing.assert_allclose(to_robot(world, pose), points, atol=1e-10)


@few
@given(poses, poses)
def test_a_point_carried_by_two_poses_is_carried_by_their_composition(a, b):
    point = np.array([[0.3, -1.2]])
    np.testing.assert_allclose(to_world(to_world(point, b), a), to_world(point, compose(a, b)), atol=1e-10)


@few
@given(angles, angles)
def test_rotations_add_and_j_is_a_quarter_turn(a, b):
    np.testing.assert_allclose(rotation(a) @ rotation(b), rotation(a + b), atol=1e-12)
    np.testing.assert_allclose(rotation(a) @ rotation(a).T, np.eye(2), atol=1e-12)
    np.testing.assert_allclose(rotation(np.pi / 2), J, atol=1e-15)


@few
@given(st.floats(-1.0, 1.0), st.floats(-3.0, 3.0))
def test_an_arc_is_the_integral_of_constant_speeds(forward, turn):
    def speed(_, pose):
        return [forward * np.cos(pose[2]), forward * np.sin(pose[2]), turn]

    end = solve_ivp(speed, (0.0, 1.0), NOTHING, rtol=1e-9, atol=1e-11).y[:, -1]
    np.testing.assert_allclose(arc(forward, turn), end, atol=1e-7)


@few
@given(st.floats(-1.0, 1.0), st.floats(-3.0, 3.0), st.floats(0.0, 1.0))
def test_two_parts_of_an_arc_make_the_whole(forward, turn, share):
    first = arc(share * forward, share * turn)
    second = arc((1 - share) * forward, (1 - share) * turn)
    assert_same_pose(compose(first, second), arc(forward, turn))
