"""Which walls a scan is asked about: those near its segments, and no answer changes for the rest."""

import numpy as np
import pytest
import shapely

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.association.joint_compatibility import seen_halfway
from chainslam.slam.association.kernels import near_kernels
from chainslam.slam.association.matching import KnownWalls, MatchingConfig
from chainslam.slam.association.methods import METHODS
from chainslam.slam.association.view import near_segments
from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import compose, rotation, to_robot, wrap
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Scan
from tests.slam.test_mapper import AT_ITS_WORD, P0, faces_of

CONFIG = MatchingConfig()
WALLS, RANGE_M = 300, 8.0


def a_scan(seed):
    """Return walls with their joint Gaussian, correlated by a few common errors, and segments of some from near by."""
    rng = np.random.default_rng([11, seed])
    middles = rng.uniform(-20.0, 20.0, (WALLS, 2))
    alpha, half = rng.uniform(-np.pi, np.pi, WALLS), rng.uniform(0.1, 2.0, WALLS)
    pose = np.array([*rng.uniform(-5.0, 5.0, 2), rng.uniform(-3.0, 3.0)])
    mean = np.concatenate([pose, np.column_stack([alpha, np.zeros(WALLS)]).ravel()])
    scale = np.concatenate([[0.03, 0.03, 0.01], np.tile([0.005, 0.01], WALLS)])
    root = scale[:, None] * rng.standard_normal((len(mean), 5)) / np.sqrt(5)
    joint = Joint(mean, root @ root.T + np.diag(0.1 * scale) ** 2, middles)
    walls = KnownWalls(np.arange(WALLS), np.stack([-half, half], axis=-1))
    ends_world = middles[:, None] + walls.extents[..., None] * directions(alpha)[:, None]
    true = compose(pose, rng.standard_normal(3) * np.array([0.03, 0.03, 0.01]))
    away = true[:2] - middles
    seen = np.flatnonzero((np.hypot(*away.T) < RANGE_M) & (np.vecdot(away, normals(alpha)) < -0.1))
    seen = seen[rng.permutation(len(seen))[:10]]
    ends = to_robot(ends_world[seen], true)
    lines = np.column_stack([wrap(alpha[seen] - true[2]), np.vecdot(ends[:, 0], normals(alpha[seen] - true[2]))])
    foot = np.vecdot(ends.mean(axis=1), directions(lines[:, 0]))
    cov = np.zeros((len(seen), 2, 2))
    cov[:, 0, 0], cov[:, 1, 1] = 1e-4, 1e-4 + 1e-4 * foot**2
    cov[:, 0, 1] = cov[:, 1, 0] = 1e-4 * foot
    count = len(seen)
    beams, sure = np.zeros((count, 2), dtype=np.int64), np.zeros(count, dtype=bool)
    segments = Segments(lines, cov, ends, beams, np.full(count, 20), beams > 0, np.zeros(count), sure)
    return segments, walls, joint, ends_world


def taken(walls, joint, rows):
    columns = np.concatenate([np.arange(3), (3 + 2 * rows[:, None] + np.arange(2)).ravel()])
    return (
        KnownWalls(walls.ids[rows], walls.extents[rows]),
        Joint(joint.mean[columns], joint.cov[np.ix_(columns, columns)], joint.anchors[rows]),
    )


@pytest.mark.parametrize("name", METHODS)
@pytest.mark.parametrize("seed", range(6))
def test_walls_far_from_all_segments_change_no_match(name, seed):
    segments, walls, joint, ends_world = a_scan(seed)
    near = np.flatnonzero(near_segments(segments, ends_world, joint.mean[:3], joint.cov[:3, :3], CONFIG))
    assert len(segments) <= len(near) < WALLS / 2
    method, few = METHODS[name], taken(walls, joint, near)
    first = [method.matcher(segments, *known, CONFIG, clear_only=True) for known in ((walls, joint), few)]
    again = [
        method.matcher(
            segments,
            known,
            method.relocate(prior, seen_halfway(prior, known.ids, clear.observations(segments))),
            CONFIG,
        )
        for (known, prior), clear in zip(((walls, joint), few), first, strict=True)
    ]
    assert len(again[0].pairs) > 3
    for all_walls, near_walls in (first, again):
        for part in ("pairs", "unmatched", "doubtful"):
            np.testing.assert_array_equal(getattr(all_walls, part), getattr(near_walls, part))
        np.testing.assert_allclose(all_walls.distances, near_walls.distances, rtol=1e-6)


def test_the_more_the_robot_is_lost_the_farther_it_looks():
    segments, _, joint, ends_world = a_scan(0)
    counts = [
        np.count_nonzero(near_segments(segments, ends_world, joint.mean[:3], scale**2 * joint.cov[:3, :3], CONFIG))
        for scale in (0.0, 1.0, 5.0, 100.0)
    ]
    assert counts[0] < counts[1] < counts[2] < counts[3] == WALLS
    turned = joint.mean[:3] + np.array([0.0, 0.0, 0.3])
    apart = rotation(0.3) @ segments.ends[0, 0] - segments.ends[0, 0]
    sure, unsure = (np.diag([1e-8, 1e-8, sigma**2]) for sigma in (1e-4, 0.1))
    assert np.hypot(*apart) > CONFIG.shared.far_m
    lost, found = (near_segments(segments, ends_world, turned, cov, CONFIG) for cov in (sure, unsure))
    assert np.all(found[lost])
    assert np.count_nonzero(found) > np.count_nonzero(lost)


@pytest.mark.parametrize("seed", range(4))
def test_near_are_the_walls_that_shapely_finds_within_reach(seed):
    segments, _, joint, ends_world = a_scan(seed)
    pose, off_m, off_rad = joint.mean[:3], 0.4, 0.1
    found = np.zeros(len(ends_world), dtype=bool)
    for ends in segments.ends:
        seen = shapely.LineString(ends @ rotation(pose[2]).T + pose[:2])
        reach = off_m + off_rad * np.hypot(*ends.T).max()
        found |= shapely.distance(seen, shapely.linestrings(ends_world)) < reach
    assert 0 < np.count_nonzero(found) < len(found)
    np.testing.assert_array_equal(near_kernels.near_segments(segments.ends, ends_world, pose, off_m, off_rad), found)


def test_without_segments_or_walls_nothing_is_near():
    segments, _, joint, ends_world = a_scan(1)
    none = segments.take(np.zeros(0, dtype=np.int64))
    assert not near_segments(none, ends_world, joint.mean[:3], joint.cov[:3, :3], CONFIG).any()
    assert not len(near_segments(segments, ends_world[:0], joint.mean[:3], joint.cov[:3, :3], CONFIG))


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_a_robot_that_may_be_far_off_knows_a_wall_that_it_believes_out_of_sight(backend):
    """A corridor tells nothing of where along it the robot is, until its end does: wheels that slip slid by a metre."""
    finder, pose = RangeFinder(faces_of(shapely.box(0, 0, 12, 1.6)), LidarConfig()), np.array([9.0, 0.8, 0.0])
    mapper = Mapper(BACKENDS[backend].make(pose.copy(), P0.copy()), AT_ITS_WORD)

    def moved(told, true, sigma_m):
        mapper.predict(Odometry(np.array([told, 0.0, 0.0]), np.diag([sigma_m, 0.01, 0.005]) ** 2))
        pose[0] += true
        return mapper.step(Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0))

    known = [moved(0.05, 0.05, 0.01) for _ in range(6)][-1].map
    away = moved(-2.0, -2.0, 0.01).map
    assert len(known) == len(away) == 3
    assert away.distances_m.max() > 4.0 + mapper.config.matching.shared.far_m, "no scan of 4 m shows the end from here"
    there = moved(0.0, 1.0, 1.0).map
    assert there.ids.tolist() == known.ids.tolist()
    np.testing.assert_allclose(there.belief.pose_world, pose, atol=1e-3)
