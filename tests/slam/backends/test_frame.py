"""A map that begins in the blind: what was lost before the first wall stays what it is, and spoils nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.backends import BACKENDS
from chainslam.slam.backends.frame.frame import Frame
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.geometry.poses import compose, inverse, to_world, wrap
from chainslam.slam.robot import Odometry

few = settings(max_examples=20, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
START, P0 = np.array([0.0, -1.0, 0.3]), np.diag([0.01, 0.01, 0.002]) ** 2
LOST = np.diag([0.5, 0.5, 0.1]) ** 2
"""What 3 m without a wall in sight cost: half a metre and 6 degrees."""
EKFS = [name for name, entry in BACKENDS.items() if entry.options is EkfConfig]

pytestmark = pytest.mark.usefixtures("_unchecked")


def spread(root, rng):
    """Return a covariance of so many dimensions."""
    A = rng.standard_normal((root, root))
    return 1e-2 * (A @ A.T + np.eye(root))


def placed(frame_world, state, anchors, anchors_world):
    """Return pose and lines (alpha, d), about anchors of the world, of a state in a frame that lies elsewhere."""
    alpha, d = state[3::2], state[4::2]
    points = anchors + d[:, None] * np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)
    turned = alpha + frame_world[2]
    off = to_world(points, frame_world) - anchors_world
    across = off[:, 0] * np.cos(turned) + off[:, 1] * np.sin(turned)
    return np.concatenate([compose(frame_world, state[:3]), np.stack([turned, across], axis=-1).ravel()])


@few
@given(seed=seeds)
def test_the_joint_in_the_world_is_that_of_the_map_and_the_frame_to_first_order(seed):
    rng = np.random.default_rng(seed)
    frame = Frame(rng.uniform(-3, 3, 3), spread(3, rng))
    state, anchors = rng.uniform(-1, 1, 9), rng.uniform(-5, 5, (3, 2))
    inner = Joint(state, spread(9, rng), anchors)
    world = frame.joint_world(inner)

    def at(errors):
        return placed(frame.pose_world + errors[:3], state + errors[3:], anchors, world.anchors)

    off = at(np.zeros(12)) - world.mean
    off[[2, 3, 5, 7]] = wrap(off[[2, 3, 5, 7]])
    np.testing.assert_allclose(off, 0.0, atol=1e-12)
    D = np.stack([(at(step) - at(-step)) / 2e-6 for step in 1e-6 * np.eye(12)], axis=-1)
    both = np.zeros((12, 12))
    both[:3, :3], both[3:, 3:] = frame.cov, inner.cov
    np.testing.assert_allclose(world.cov, D @ both @ D.T, rtol=1e-6, atol=1e-8)


def blind_start(name, walls, steps=80):
    """Lose the way before the first wall, as LOST says, then drive on; return beliefs, and true poses."""
    rng, backend = np.random.default_rng(61), BACKENDS[name].make(START, P0)
    backend.predict(Odometry(np.zeros(3), LOST))
    slip = np.sqrt(np.diag(LOST)) * rng.standard_normal(3)
    tour = walls.tour(backend, compose(START, slip), rng, steps)
    return zip(*((backend.belief, true) for true in tour), strict=True)


@pytest.mark.parametrize("name", EKFS)
def test_no_filter_learns_from_its_walls_where_it_was_when_it_saw_the_first(name, make_walls):
    beliefs, _ = blind_start(name, make_walls(16))
    least = min(belief.pose_cov[2, 2] for belief in beliefs) / LOST[2, 2]
    print(f"{name}: least variance of the heading over that at the first wall: {least:.6f}")
    assert least >= 1.0 - 1e-9


def test_walls_seen_after_a_blind_start_are_true_to_each_other(make_walls):
    """Beside the frame's own error the full filter's pose is off by centimetres, not by what was lost before."""
    beliefs, true = blind_start("full-ekf", make_walls(16))
    first = compose(beliefs[0].pose_world, inverse(true[0]))
    off = [
        compose(inverse(compose(first, pose)), belief.pose_world) for belief, pose in zip(beliefs, true, strict=True)
    ]
    assert np.hypot(*first[:2]) > 0.1
    assert np.abs(off)[:, :2].max() < 0.1
    joint = beliefs[-1].joint(beliefs[-1].ids)
    assert np.linalg.eigvalsh(joint.cov).min() > 0.0
    np.testing.assert_array_equal(joint.cov, joint.cov.T)


def test_a_map_that_begins_with_a_wall_in_sight_has_the_worlds_frame(make_walls):
    rng, walls = np.random.default_rng(62), make_walls(16)
    for name in EKFS:
        backend = BACKENDS[name].make(START, P0)
        backend.grow(*walls.look(START, np.arange(6), rng))
        backend.predict(Odometry(np.zeros(3), LOST))
        backend.grow(*walls.look(START, np.arange(6, 9), rng))
        assert backend._frame is None


def test_a_map_that_was_lost_altogether_begins_anew(make_walls):
    rng, walls = np.random.default_rng(63), make_walls(16)
    backend = BACKENDS["full-ekf"].make(START, P0)
    ids = backend.grow(*walls.look(START, np.arange(2), rng))
    backend.predict(Odometry(np.zeros(3), LOST))
    backend.remove(ids.tolist())
    before = backend.belief
    again = backend.grow(*walls.look(START, np.arange(2), rng))
    assert min(again) > max(ids)
    np.testing.assert_allclose(backend.belief.pose_world, before.pose_world, atol=1e-12)
    np.testing.assert_allclose(backend.belief.pose_cov, before.pose_cov, atol=1e-12)
    assert backend._frame is not None


@few
@given(seed=seeds)
def test_a_frame_moves_with_the_robot_and_its_covariance_to_first_order(seed):
    rng = np.random.default_rng(seed)
    frame, odometry = Frame(rng.uniform(-3, 3, 3), spread(3, rng)), Odometry(rng.uniform(-1, 1, 3), spread(3, rng))

    def at(errors):
        return compose(frame.pose_world + errors[:3], odometry.motion + errors[3:])

    moved = frame.moved(odometry)
    np.testing.assert_allclose(moved.pose_world, at(np.zeros(6)), atol=1e-12)
    D = np.stack([wrap_heading(at(step) - at(-step)) / 2e-6 for step in 1e-6 * np.eye(6)], axis=-1)
    both = np.zeros((6, 6))
    both[:3, :3], both[3:, 3:] = frame.cov, odometry.cov
    np.testing.assert_allclose(moved.cov, D @ both @ D.T, rtol=1e-6, atol=1e-9)


def wrap_heading(step):
    """Return a difference of two poses, its heading wrapped."""
    return np.array([step[0], step[1], wrap(step[2])])
