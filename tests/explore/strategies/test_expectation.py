"""What is expected of a place, against a dense Kalman update done another way, and what must hold of it."""

import networkx as nx
import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.explore.strategies.expectation import (
    OBSERVATION_SIGMAS,
    drift_sigmas,
    expect,
    walls_seen_from,
)
from chainslam.explore.strategies.uncertainty import Uncertainty, new_wall_nats, unknown_wall
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.robot import WheelSpec

few = settings(max_examples=25, deadline=None, derandomize=True)


def covariance(rng, count, scale=0.02):
    """Return a random joint covariance of the pose and `count` lines."""
    root = rng.normal(0, scale, (3 + 2 * count, 5 + 3 * count))
    return root @ root.T / root.shape[1] + 1e-6 * np.eye(3 + 2 * count)


def place_and_walls(scene, rng):
    pose = np.append(scene.places[rng.integers(len(scene.places))], rng.uniform(-3, 3))
    place = scene.places[rng.integers(len(scene.places))]
    walls = scene.walls(pose, covariance(rng, len(scene.faces)))
    return walls, place, np.sort(rng.permutation(len(scene.faces))[: rng.integers(1, 6)])


@few
@given(st.integers(0, 2**32), st.floats(0.0, 30.0))
def test_the_expected_pose_and_gain_are_those_of_a_kalman_update_in_information_form(scene_of, seed, metres):
    """The Jacobian by finite differences, the update by inverses, the gain by conditional entropies."""
    rng = np.random.default_rng(seed)
    scene = scene_of(seed % 5)
    walls, place, seen = place_and_walls(scene, rng)
    joint, m = walls.belief.joint(seen), len(seen)
    F = np.eye(3 + 2 * m)
    way = place - walls.belief.pose_world[:2]
    F[0, 2], F[1, 2] = -way[1], way[0]
    prior = F @ joint.cov @ F.T + np.diag(np.append(drift_sigmas(WheelSpec()) ** 2 * metres, np.zeros(2 * m)))
    ends = walls.ends_world[seen]
    along = ends[:, 1] - ends[:, 0]
    share = np.clip(np.sum((place - ends[:, 0]) * along, axis=1) / np.sum(along**2, axis=1), 0, 1)
    nearest = ends[:, 0] + share[:, None] * along
    state = joint.mean.copy()
    state[:2] = place
    steps = 1e-6 * np.eye(len(state))

    def h(x):
        # The seen point stays on its beam while the state varies: its own place is a constant of the look.
        p, lines = x[:3], x[3:].reshape(m, 2)
        foot = np.sum(directions(state[3::2]) * (nearest - state[:2]), axis=-1)
        r = lines[:, 1] + np.sum(normals(lines[:, 0]) * (joint.anchors - p[:2]), axis=-1)
        epsilon = (lines[:, 0] - p[2]) - (state[3::2] - state[2])
        return np.stack([lines[:, 0] - p[2], r - foot * epsilon], axis=-1).ravel()

    H = np.stack([(h(state + d) - h(state - d)) / 2e-6 for d in steps], axis=1)
    R = np.diag(np.tile(OBSERVATION_SIGMAS**2, m))
    after = np.linalg.inv(np.linalg.inv(prior) + H.T @ np.linalg.inv(R) @ H)
    found = expect(walls, seen, place, metres)
    np.testing.assert_allclose(found.pose_cov, after[:3, :3], rtol=1e-4, atol=1e-12)
    gain = 0.5 * np.linalg.slogdet(prior[3:, 3:])[1] - 0.5 * np.linalg.slogdet(after[3:, 3:])[1]
    assert found.map_gain_nats == pytest.approx(gain, abs=1e-4)


@few
@given(st.integers(0, 2**32), st.floats(0.0, 10.0))
def test_seeing_more_walls_or_driving_less_never_makes_the_pose_worse(scene_of, seed, metres):
    rng = np.random.default_rng(seed)
    walls, place, seen = place_and_walls(scene_of(seed % 5), rng)
    cov = expect(walls, seen, place, metres).pose_cov
    fewer, farther = expect(walls, seen[:-1], place, metres), expect(walls, seen, place, metres + 3.0)
    assert np.linalg.eigvalsh(fewer.pose_cov - cov).min() > -1e-12
    assert np.linalg.eigvalsh(farther.pose_cov - cov).min() > -1e-12
    assert farther.map_gain_nats <= expect(walls, seen, place, metres).map_gain_nats + 1e-9


@pytest.mark.parametrize("seed", range(5))
def test_walls_seen_from_a_place_are_those_of_the_graph_whose_free_side_it_is_on(scene_of, seed):
    scene = scene_of(seed)
    walls = scene.walls(np.zeros(3))
    count = len(scene.faces)
    graph = nx.DiGraph([(0, k) for k in range(1, count, 2)] + [(1, 2), (0, 999)])
    place = scene.places[seed]
    seen = set(walls_seen_from(walls, graph, 0, place, reach_m=9.0, most=50).tolist())
    left = np.sum((place - scene.faces[:, 0]) * -normals(walls.belief.means[:, 0]), axis=1) > 1e-9
    assert seen - {0} <= set(range(1, count, 2)) & set(np.flatnonzero(left).tolist())
    assert 0 in seen
    assert len(walls_seen_from(walls, graph, 0, place, reach_m=9.0, most=3)) <= 3


def test_of_two_ends_as_far_away_the_one_at_the_better_known_wall_is_chosen(scene_of):
    """The two ends of one wall are moved to be as far away; then only what is known of the walls decides."""
    scene = scene_of(0)
    count = len(scene.faces)
    pose = np.append(scene.places[0], 0.0)
    for better, worse in ((0, 2), (2, 0)):
        cov = np.diag(np.append([1e-4, 1e-4, 1e-5], np.full(2 * count, 1e-5)))
        cov[3 + 2 * worse : 5 + 2 * worse] *= 1e3
        situation = scene.situation(pose, [(0,), (2,)], cov=cov)
        situation.__dict__["end_metres"] = np.full(4, 3.0)
        assert Uncertainty().choose(situation).target.wall == better


def test_a_new_wall_is_worth_less_the_worse_the_pose_is_known(scene_of):
    scene = scene_of(1)
    situation = scene.situation(np.append(scene.places[0], 0.0), [(0,)])
    end = situation.open_ends[0]
    pose, cov, nats = np.append(scene.places[0], 0.0), covariance(np.random.default_rng(0), len(scene.faces)), []
    for scale in (1.0, 4.0, 16.0):
        known = expect(scene.walls(pose, scale * cov), np.array([0]), scene.places[0], 0.0)
        nats.append(new_wall_nats(situation, end, known))
    assert nats[0] > nats[1] > nats[2] > 0
    assert np.linalg.det(unknown_wall(8.0)) == pytest.approx(4.0 * np.linalg.det(unknown_wall(4.0)))


def test_what_a_way_adds_follows_from_the_wheels():
    np.testing.assert_array_equal(drift_sigmas(WheelSpec()), [0.02, 0.02, 0.07])
    np.testing.assert_allclose(drift_sigmas(WheelSpec(base_m=0.16, slip=0.001)), [0.001, 0.001, 0.009])
