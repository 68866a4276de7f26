"""What an overconfident belief cannot hide: information from nowhere, large innovations, heading lost in the blind."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.linalg

from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.strategies.inconsistency import LEVEL, Monitor, gained_information, stated
from chainslam.slam.association.joint_compatibility import Nis
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import J, compose
from chainslam.slam.robot import Odometry, Scan

START = np.array([3.0, -2.0, 0.4])
START_COV = np.diag([0.02, 0.02, 0.01]) ** 2
NOTHING_SEEN = Scan(np.linspace(-3.1, 3.1, 180), np.full(180, np.inf), 0.01, 4.0, 0.0)


def moved(mean, anchors, shift, turn):
    """Return pose and lines after everything is turned about the origin and shifted, without any derivative."""
    motion = np.array([*shift, turn])
    pose = compose(motion, mean[:3])
    alpha, d = mean[3::2], mean[4::2]
    points = anchors + d[:, None] * normals(alpha)
    rotated = points @ np.array([[np.cos(turn), np.sin(turn)], [-np.sin(turn), np.cos(turn)]]) + shift
    return np.concatenate(
        [pose, np.stack([alpha + turn, np.sum(normals(alpha + turn) * (rotated - anchors), -1)], -1).ravel()]
    )


def drawn(seed, count=6):
    """Return pose, lines and how they move with everything, by differences; and a covariance of what else is unsure."""
    rng = np.random.default_rng(seed)
    mean = np.concatenate([rng.uniform(-20, 20, 2), rng.uniform(-3, 3, 1), rng.uniform(-3, 3, 2 * count) * 0.1])
    mean[3::2] = rng.uniform(-3, 3, count)
    anchors = rng.uniform(-20, 20, (count, 2))
    step = 1e-6
    columns = []
    for k in range(3):
        way = step * np.eye(3)[k]
        columns.append((moved(mean, anchors, way[:2], way[2]) - moved(mean, anchors, -way[:2], -way[2])) / (2 * step))
    root = rng.normal(0.0, 0.01, (len(mean), len(mean)))
    return mean, anchors, np.stack(columns, axis=-1), root @ root.T + 1e-8 * np.eye(len(mean))


def about_origin(cov):
    """Return the start's covariance as that of a motion of everything about the origin."""
    back = np.eye(3)
    back[:2, 2] = -J @ START[:2]
    return back @ cov @ back.T


@pytest.mark.parametrize("seed", range(8))
def test_an_honest_belief_has_no_more_information_about_where_the_world_lies_than_the_start(seed):
    mean, anchors, N, rest = drawn(seed)
    start = about_origin(START_COV)
    cov = N @ start @ N.T + rest
    gained = gained_information(Joint(mean, cov, anchors), START, START_COV)
    dense = scipy.linalg.eigh(N.T @ np.linalg.inv(cov) @ N, np.linalg.inv(start), eigvals_only=True)[-1]
    assert gained == pytest.approx(dense, rel=1e-4)
    assert 0.0 < gained <= 1.0 + 1e-6


@pytest.mark.parametrize("seed", range(8))
def test_a_belief_without_its_cross_covariances_or_with_too_small_ones_shows_it(seed):
    mean, anchors, N, rest = drawn(seed)
    cov = N @ about_origin(START_COV) @ N.T + 1e-3 * rest
    blocks = np.kron(np.eye(len(mean)), 1.0) * cov
    for k in range(3, len(mean), 2):
        blocks[k : k + 2, k : k + 2] = cov[k : k + 2, k : k + 2]
    blocks[:3, :3] = cov[:3, :3]
    assert gained_information(Joint(mean, blocks, anchors), START, START_COV) > 2.0
    assert gained_information(Joint(mean, 0.01 * cov, anchors), START, START_COV) > 50.0


def test_a_covariance_that_is_none_has_all_information():
    joint = Joint(START.copy(), np.zeros((3, 3)), np.zeros((0, 2)))
    assert gained_information(joint, START, START_COV) == np.inf


def around_of(scene, pose=(3.0, 3.0, 0.0), seen=(), cov=None, nis=(0.0, 0), heading_var=0.0):
    """Return what one step sees: walls, the NIS of it, and what the wheels may have turned."""
    return Surroundings(
        scene.walls(np.array(pose), cov), scene.grid, NOTHING_SEEN, seen=seen, nis=Nis(*nis),
        odometry=Odometry(np.zeros(3), np.diag([0.0, 0.0, heading_var])),
    )  # fmt: skip


def test_innovations_as_stated_pass_the_end_of_their_band_as_often_as_the_level_says(scene_of):
    scene, rng = scene_of(0), np.random.default_rng(3)
    beyond, windows = 0, 600
    steps = [around_of(scene, seen=(0,)), around_of(scene, seen=(3,))]
    for values in rng.chisquare(6, (windows, 3)):
        monitor = Monitor()
        monitor.watch(steps[0])
        for value in values:
            monitor.watch(replace(steps[1], nis=Nis(value, 6)))
        beyond += monitor.surprise() > 1.0
    assert abs(beyond - (1 - LEVEL) * windows) < 4.0 * np.sqrt((1 - LEVEL) * windows)


def test_innovations_three_times_too_large_pass_it_and_a_known_wall_forgets_them(scene_of):
    scene, monitor = scene_of(0), Monitor()
    sure = np.eye(3 + 2 * len(scene.faces)) * 1e-12
    monitor.watch(around_of(scene, seen=(0,), nis=(1000.0, 2), cov=sure))
    assert monitor.surprise() == 0.0
    for _ in range(5):
        monitor.watch(around_of(scene, seen=(3,), nis=(18.0, 6)))
    assert monitor.surprise() > 1.5
    assert monitor.overconfidence(around_of(scene, seen=(3,))) == pytest.approx(monitor.surprise())
    monitor.watch(around_of(scene, seen=(0, 3), nis=(18.0, 6)))
    assert monitor.surprise() == 0.0
    assert monitor.in_sight


def turned_on_the_way(scene, known, places, variance):
    """Return an honest covariance: the robot and all walls but the known ones were turned at each of some places."""
    count = len(scene.faces)
    ends = scene.faces
    along = (ends[:, 1] - ends[:, 0]) / np.hypot(*(ends[:, 1] - ends[:, 0]).T)[:, None]
    n = np.stack([along[:, 1], -along[:, 0]], axis=-1)
    cov = np.eye(3 + 2 * count) * 1e-10
    for place in places:
        h = np.zeros(3 + 2 * count)
        h[2] = 1.0
        h[:2] = J @ (places[-1] - place)
        for wall in set(range(count)) - set(known):
            h[3 + 2 * wall] = 1.0
            h[4 + 2 * wall] = n[wall] @ J @ (ends[wall].mean(axis=0) - place)
        cov += variance / len(places) * np.outer(h, h)
    return cov


def driven(scene, cov, known, places, **rest):
    """Return a monitor that saw the known walls first and then drove by some places, and the last step."""
    monitor = Monitor()
    # The start was known far better than anything since: the belief gains nothing about where the world lies.
    monitor.watch(around_of(scene, np.append(places[0], 0.0), known, np.eye(3 + 2 * len(scene.faces)) * 1e-12))
    for place in places:
        last = around_of(scene, np.append(place, 0.0), (5,), cov, **rest)
        monitor.watch(last)
    return monitor, last


@pytest.mark.parametrize("seed", range(3))
def test_an_honest_belief_expects_known_walls_as_far_off_as_it_says(seed, scene_of):
    """Heading lost evenly on the way: what is predicted without the belief's positions is what the belief states."""
    scene, known = scene_of(seed), (0, 1)
    places = np.linspace([1.0, 1.0], [5.0, 4.0], 12)
    cov = turned_on_the_way(scene, known, places, 0.02**2)
    monitor, last = driven(scene, cov, known, places)
    assert monitor.overconfidence(last) == 1.0
    assert 0.7 < monitor.predicted(last, places[-1], 0.0) <= 1.05


@pytest.mark.parametrize("seed", range(3))
def test_a_belief_that_claims_too_much_expects_known_walls_far_off(seed, scene_of):
    scene, known = scene_of(seed), (0, 1)
    places = np.linspace([1.0, 1.0], [5.0, 4.0], 12)
    cov = turned_on_the_way(scene, known, places, 0.02**2)
    _, last = driven(scene, cov, known, places)
    monitor = Monitor()
    start = np.eye(3 + 2 * len(scene.faces)) * 0.1**2
    monitor.watch(around_of(scene, np.append(places[0], 0.0), known, start))
    for place in places:
        monitor.watch(around_of(scene, np.append(place, 0.0), (5,), cov))
    assert monitor.overconfidence(last) > 10.0
    assert monitor.predicted(last, places[-1], 0.0) > 10.0
    farther = monitor.predicted(last, places[-1] + [30.0, 30.0], 30.0)
    assert farther > 5.0 * monitor.predicted(last, places[-1], 0.0)


def test_heading_lost_in_the_blind_counts_until_a_wall_from_before_gives_it_back(scene_of):
    scene, known = scene_of(0), (0, 1)
    places = np.linspace([1.0, 1.0], [5.0, 4.0], 12)
    cov = np.eye(3 + 2 * len(scene.faces)) * 1e-6
    plain = Monitor()
    start = np.eye(3 + 2 * len(scene.faces)) * 1e-12
    plain.watch(around_of(scene, np.append(places[0], 0.0), known, start))
    plain.watch(around_of(scene, np.append(places[1], 0.0), (5,), cov))
    before = plain.predicted(around_of(scene, np.append(places[1], 0.0), (5,), cov), places[1], 0.0)
    for place in places[2:6]:
        plain.watch(around_of(scene, np.append(place, 0.0), (), cov, heading_var=0.05**2))
    plain.watch(around_of(scene, np.append(places[5], 0.0), (7,), cov))
    here = around_of(scene, np.append(places[5], 0.0), (7,), cov)
    lost = plain.predicted(here, places[5], 0.0)
    assert lost > 50.0 * max(before, 1e-3)
    plain.watch(around_of(scene, np.append(places[5], 0.0), (7, 5), cov))
    assert plain.predicted(here, places[5], 0.0) < 0.02 * lost


def test_only_what_stands_beside_a_known_wall_becomes_known(scene_of):
    scene, monitor = scene_of(0), Monitor()
    monitor.watch(around_of(scene))
    assert not monitor.known
    monitor.watch(around_of(scene, seen=(0, 1)))
    monitor.watch(around_of(scene, seen=(1, 2)))
    assert monitor.known == {0, 1}
    monitor.learn((2, 3))
    assert monitor.known == {0, 1}
    monitor.learn((1, 2))
    assert monitor.known == {0, 1, 2}


def test_what_a_belief_states_of_a_wall_is_its_covariance_in_the_robots_frame(scene_of):
    """Against draws: the wall's direction, and how far its middle lies off, as a robot at each drawn pose sees them."""
    scene, rng = scene_of(0), np.random.default_rng(5)
    count = len(scene.faces)
    root = rng.normal(0.0, 1e-4, (3 + 2 * count, 3 + 2 * count))
    walls = scene.walls(np.array([2.0, 3.0, 0.7]), root @ root.T)
    chosen = np.array([2])
    joint = walls.belief.joint(chosen)
    point = walls.ends_world[2].mean(axis=0)
    draws = rng.multivariate_normal(joint.mean, joint.cov, 20000)
    direction = draws[:, 3] - draws[:, 2]
    seen = normals(joint.mean[3:4])[0] @ (point - joint.mean[:2])
    turned = draws[:, 2] - joint.mean[2]
    # The point that the robot takes for the wall's middle, by its own pose, against where the wall lies there.
    local = point - joint.mean[:2]
    cosine, sine = np.cos(turned), np.sin(turned)
    taken = draws[:, :2] + np.stack([cosine * local[0] - sine * local[1], sine * local[0] + cosine * local[1]], -1)
    off = draws[:, 4] + np.sum(normals(draws[:, 3]) * (joint.anchors[0] - taken), axis=-1)
    assert np.isfinite(seen)
    variances = stated(walls.belief, chosen, point[None])
    assert variances[0][0] == pytest.approx(direction.var(), rel=0.05)
    assert variances[1][0] == pytest.approx(off.var(), rel=0.05)
