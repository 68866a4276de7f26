"""What the beams of many scans draw of two faces that each scan takes for one wall, and what the map makes of them."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from sim.lidar import LidarConfig, RangeFinder
from slam.backends import BACKENDS
from slam.config import MapperConfig
from slam.estimation.backend import Belief, Joint
from slam.estimation.shared import SharedConfig
from slam.extraction.extract import extract
from slam.geometry.poses import compose, inverse
from slam.map.extents import WallsConfig
from slam.map.landmarks import Landmarks
from slam.map.polylines.change_points import ChangePointsConfig
from slam.map.polylines.kernels.split_kernels import Fit, best_split, binned, fitted, placed
from slam.map.polylines.splits import Split, Splits
from slam.map.polylines.wall_beams import beams_on_walls
from slam.map.records import Records
from slam.mapper import Mapper
from slam.robot import Odometry, Scan

SIGMA_M, WALL, SURE = 0.01, 7, 5
AROUND = np.array([[[3.0, -4.0], [3.0, 2.0]], [[3.0, 2.0], [-3.0, 2.0]], [[-3.0, 2.0], [-3.0, -4.0]]])
"""Long walls about the robot, by which it knows where it stands."""


def stepped(step_m, half_m=0.4):
    """Return two faces along y = 0, free side below, the left one farther back; and what is between and beside them."""
    way = [[half_m, 1.0], [half_m, 0.0], [0.0, 0.0], [0.0, step_m], [-half_m, step_m], [-half_m, 1.0]]
    return np.array([[way[k], way[k + 1]] for k in range(len(way) - 1) if way[k] != way[k + 1]])


def random_poses(rng, count):
    """Return poses before the faces, from which each scan has few beams on them."""
    return np.column_stack([rng.uniform(-1, 1, count), rng.uniform(-3.8, -2.5, count), rng.uniform(-3, 3, count)])


def scans(faces, poses, rng, sigma_m=SIGMA_M):
    """Yield noisy scans from poses; the noise stated is 10 mm."""
    finder = RangeFinder(faces, LidarConfig())
    for k, pose in enumerate(poses):
        ranges = finder.cast(pose)[0]
        yield Scan(finder.bearings_rad, ranges + sigma_m * rng.standard_normal(len(ranges)), SIGMA_M, 5.0, 0.1 * k)


def belief_of(pose, alpha, d, sigmas=(0.003, 0.001), pose_sigma=1e-4):
    """Return a belief in one wall anchored at the origin, known as well as stated."""
    mean, cov = np.array([*pose, alpha, d]), np.diag([pose_sigma, pose_sigma, pose_sigma, *sigmas]) ** 2
    anchors = np.zeros((1, 2))
    return Belief(pose, cov[:3, :3], np.array([WALL]), anchors, mean[None, 3:], lambda ids: Joint(mean, cov, anchors))


def first_split(faces, poses, rng, alpha, d, config=None, off_m=0.0, **known):
    """Show scans of some faces as one wall; return after how many it is split, and the split.

    Every other scan is believed to be taken so far nearer to the faces.
    """
    landmarks = Landmarks(config or WallsConfig(), ChangePointsConfig(), SURE)
    for k, (pose, scan) in enumerate(zip(poses, scans(faces, poses, rng), strict=True)):
        pose = pose + np.array([0.0, off_m * (k % 2), 0.0])
        belief, segments = belief_of(pose, alpha, d, **known), extract(scan)
        on = np.flatnonzero(np.abs(segments.lines[:, 0] + pose[2] - np.pi / 2) % (2 * np.pi) < 0.5)
        owners = np.full(len(segments), -1)
        owners[on] = WALL
        landmarks.observe(belief, scan, segments, owners)
        pairs = np.stack([on, owners[on]], axis=-1)
        split = landmarks.split_of(belief, beams_on_walls(belief, scan, segments, pairs, SharedConfig()))
        if split is not None:
            return k, split
    return None


def line_through(step_m, half_m=0.4):
    """Return (alpha, d) about the origin of the line that fits both faces best."""
    x = np.linspace(-half_m, half_m, 1000)
    slope, off = np.polyfit(x, np.where(x < 0.0, step_m, 0.0), 1)
    alpha = np.arctan2(1.0, -slope)
    return alpha, off * np.sin(alpha)


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


@pytest.mark.parametrize("seed", range(3))
@pytest.mark.parametrize("step_m", [0.02, 0.03, -0.02])
def test_two_faces_that_every_scan_takes_for_one_are_found_where_they_are(step_m, seed):
    """What is stated of each holds: it is parallel to the x-axis, and its end is known to a piece."""
    rng = np.random.default_rng(seed)
    found = first_split(stepped(step_m), random_poses(rng, 600), rng, *line_through(step_m))
    assert found is not None
    split, pose = found[1], random_poses(np.random.default_rng(seed), 600)[found[0]]
    assert len(split.lines) == 2
    c, s = np.cos(pose[2]), np.sin(pose[2])
    centres = split.centres @ np.array([[c, s], [-s, c]]) + pose[:2]
    order = np.argsort(-centres[:, 0])
    across = centres[order, 1] - np.array([0.0, step_m])
    turn = split.lines[order, 0] + pose[2] - np.pi / 2
    turn = (turn + np.pi) % (2 * np.pi) - np.pi
    t = np.stack([-np.cos(turn), -np.sin(turn)], axis=-1)
    lever = -np.vecdot(t, centres[order] - pose[:2])
    for k, row in enumerate(order):
        J = np.array([[1.0, 0.0], [lever[k], 1.0]])
        own = J @ split.cov[row] @ J.T
        error = np.array([turn[k], across[k]])
        assert error @ np.linalg.solve(own, error) < chi2.isf(1e-4, 2)
        assert np.sqrt(own[0, 0]) < np.deg2rad(4.0)
    # Along t, which leads to the left here, the right face ends where the left one begins.
    inner = centres[order, 0] - np.array([split.extents[order[0], 1], split.extents[order[1], 0]])
    np.testing.assert_allclose(inner, 0.0, atol=0.06)


@pytest.mark.parametrize("seed", range(3))
def test_a_flat_wall_is_never_two(seed):
    rng = np.random.default_rng(seed)
    assert first_split(stepped(0.0), random_poses(rng, 700), rng, np.pi / 2, 0.0) is None


@pytest.mark.parametrize("turned_rad", [0.03, -0.05])
def test_a_flat_wall_whose_line_is_wrong_is_not_two_either(turned_rad):
    rng = np.random.default_rng(0)
    assert first_split(stepped(0.0), random_poses(rng, 300), rng, np.pi / 2 + turned_rad, 0.003) is None


def test_faces_of_which_scans_do_not_agree_where_they_are_split_no_wall():
    """As where a loop was closed between them."""
    found = []
    for off_m in (0.0, 0.04):
        rng = np.random.default_rng(0)
        alpha, d = line_through(0.02)
        found.append(first_split(stepped(0.02), random_poses(rng, 300), rng, alpha, d + 0.5 * off_m, off_m=off_m))
    assert found[0] is not None
    assert found[1] is None


def test_a_long_wall_with_a_pilaster_near_its_end_stays_one():
    """Two lines fit it better, but its line is the one beside the pilaster: nothing is wrong with it."""
    way = [[1.5, 0.0], [0.05, 0.0], [0.05, -0.03], [-0.05, -0.03], [-0.05, 0.0], [-0.25, 0.0]]
    faces = np.array([[way[k], way[k + 1]] for k in range(len(way) - 1)])
    rng = np.random.default_rng(1)
    assert first_split(faces, random_poses(rng, 400), rng, np.pi / 2, 0.0) is None
    # Seen as a wall that is turned, it is no more the surer of the two.
    assert first_split(faces, random_poses(rng, 400), rng, np.pi / 2 + 0.03, 0.0) is not None


def test_a_wall_that_is_stated_to_be_as_far_off_is_not_split():
    line, found = line_through(0.02), []
    for sigmas in ((0.003, 0.001), (0.009, 0.003), (0.1, 0.02)):
        rng = np.random.default_rng(0)
        found.append(first_split(stepped(0.02), random_poses(rng, 300), rng, *line, sigmas=sigmas) is not None)
    assert found == [True, False, False]


def test_what_poses_may_be_off_alike_in_all_scans_is_stated_of_the_faces():
    """However many scans there were."""
    covs = []
    for pose_sigma in (1e-4, 0.02):
        rng = np.random.default_rng(2)
        _, split = first_split(stepped(0.02), random_poses(rng, 600), rng, *line_through(0.02), pose_sigma=pose_sigma)
        covs.append(split.cov)
    np.testing.assert_allclose(covs[1][:, 0, 0] - covs[0][:, 0, 0], 0.02**2, rtol=0.01)


def test_a_side_too_short_for_a_direction_begins_no_wall():
    """Where the better side is just clear enough, the other is not."""
    config, line, heading_rad = WallsConfig(), line_through(0.02), 0.15
    for count in (2, 1):
        rng = np.random.default_rng(0)
        strict = replace(config.reliability, heading_rad=heading_rad)
        _, split = first_split(stepped(0.02), random_poses(rng, 600), rng, *line, replace(config, reliability=strict))
        assert len(split.lines) == len(split.cov) == len(split.centres) == len(split.extents) == count
        heading_rad = 1.01 * float(np.sqrt(split.cov[:, 0, 0].min()))


def drive(backend, faces, poses, seed=0):
    """Go from pose to pose with known wheels; return mapper and updates."""
    mapper = Mapper(BACKENDS[backend].make(poses[0].copy(), 1e-6 * np.eye(3)), MapperConfig())
    updates = []
    for k, scan in enumerate(scans(np.concatenate([faces, AROUND]), poses, np.random.default_rng(seed))):
        if k:
            motion = compose(inverse(poses[k - 1]), poses[k])
            mapper.predict(Odometry(motion, np.diag([0.005, 0.005, np.deg2rad(0.5)]) ** 2))
        updates.append(mapper.step(scan))
    return updates


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_in_every_map_two_faces_become_two_walls(backend):
    """Which stay two, and are where they are stated to be."""
    way = np.concatenate([np.linspace(-1.5, 1.5, 80), np.linspace(1.5, -1.5, 80), np.linspace(-1.5, 1.5, 80)])
    poses = np.column_stack([way, -2.5 + 0.3 * np.sin(np.arange(240) / 30), np.zeros(240)])
    updates = drive(backend, stepped(0.02), poses)
    counts = [np.count_nonzero(level(update.map)) for update in updates]
    assert 1 in counts[:41]
    assert counts[-1] == 2
    walls = updates[-1].map
    centres = walls.ends_world[level(walls)].mean(axis=1)
    left, right = centres[np.argsort(centres[:, 0]), 1]
    assert left - right == pytest.approx(0.02, abs=0.004)
    turn = walls.belief.means[level(walls), 0] - np.pi / 2
    assert np.abs(turn).max() < np.deg2rad(2.0)
    assert not walls.crooked[level(walls)].any()


def level(walls):
    """Return which walls are those of the faces."""
    near = np.abs(walls.ends_world.mean(axis=1)).max(axis=1) < 0.5
    return near & (np.abs(np.sin(walls.belief.means[:, 0])) > 0.9)


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
    landmarks = Landmarks(WallsConfig(), ChangePointsConfig(), SURE)
    row = landmarks.records.rows(np.array([WALL]))
    landmarks.records.columns["log_odds"][row] = 7.0
    extents, ids = np.array([[-0.1, 0.2], [-0.3, 0.1]]), np.array([8, 9])
    landmarks.split(Split(WALL, np.zeros((2, 2)), np.zeros((2, 2, 2)), np.zeros((2, 2)), extents), ids)
    rows = landmarks.records.rows(ids)
    np.testing.assert_array_equal(landmarks.records.columns["log_odds"][rows], [7.0, 7.0])
    np.testing.assert_allclose(landmarks.records.columns["longest"][rows], [[0.3, 0.3], [0.4, 0.4]])
    np.testing.assert_array_equal(landmarks.records.columns["extents"][rows], extents)


def test_no_number_of_scans_makes_a_piece_of_a_face_known_to_better_than_any_wall_is():
    """Also where ranges are exact; a face has six pieces at most that count."""
    config, line = WallsConfig(), line_through(0.02)
    least = []
    for edge_m in (config.reliability.edge_m, 1e-6):
        rng = np.random.default_rng(0)
        rough = replace(config, reliability=replace(config.reliability, edge_m=edge_m))
        _, split = first_split(stepped(0.02), random_poses(rng, 600), rng, *line, rough)
        least.append(np.sqrt(split.cov[:, 0, 0].min()))
    assert least[0] > 1.1 * least[1]
