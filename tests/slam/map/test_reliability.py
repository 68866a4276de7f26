"""Straight walls stay on their lines whatever the noise; lines laid around corners are found out."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.backends import BACKENDS
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.extraction.straightness import StraightnessConfig
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.map.extents import WallsConfig
from chainslam.slam.map.landmarks import Landmarks
from chainslam.slam.map.reliability import Reliability, ReliabilityConfig, are_clear, as_told
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Scan
from tests.slam.map.scenes import bent
from tests.slam.map.test_extents import belief_of

SIGMA_M = 0.01
STEPS = shapely.Polygon([
    (0, 0), (4, 0), (4, 4), (2.16, 4), (2.16, 3.9), (2.11, 3.9), (2.11, 3.84), (2.06, 3.84), (2.06, 3.78),
    (2.0, 3.78), (2.0, 4), (0, 4),
])  # fmt: skip
"""A room with a jamb of steps of 5 cm: at 10 mm of noise a line down the stairs fits the few beams of any one scan."""


def faces_of(polygon):
    polygon = shapely.orient_polygons(polygon)
    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])


def scans(faces, poses, rng):
    finder = RangeFinder(faces, LidarConfig())
    for k, pose in enumerate(poses):
        ranges, hit = finder.cast(pose)
        yield (
            k,
            Scan(finder.bearings_rad, ranges + SIGMA_M * rng.standard_normal(len(ranges)), SIGMA_M, 4.0, 0.1 * k),
            hit,
        )


def observation(alpha, sigma_rad, beams=6, chi2=None, length_m=1.0):
    """Return one segment with a direction and how well it is known."""
    cov = np.diag([sigma_rad**2, 1e-5])[None]
    ends, none = np.array([[[1.0, 0.0], [1.0, length_m]]]), np.zeros((1, 2), dtype=int)
    chi2 = beams - 2.0 if chi2 is None else chi2
    return Segments(
        np.array([[alpha, 1.0]]), cov, ends, none, np.array([beams]), none > 0, np.array([chi2]), np.array([beams < 5])
    )


FACES = ReliabilityConfig(straightness=StraightnessConfig(edge_m=0.0), edge_m=0.0)
"""Every segment is of one face."""
OWNER = np.array([0])


@pytest.mark.parametrize("seed", range(4))
def test_real_scans_of_straight_walls_give_no_wall_a_misfit(seed):
    """Faces from 0.1 m to 4 m, seen 120 times from everywhere, each segment given to the face of its middle beam."""
    rng = np.random.default_rng(seed)
    blocks = [shapely.box(x, y, x + w, y + h) for x, y, w, h in rng.uniform([1, 1, 0.1, 0.1], [3, 3, 0.7, 0.7], (2, 4))]
    room = shapely.box(0, 0, 4, 4).difference(shapely.union_all(blocks))
    faces = faces_of(room)
    places = rng.uniform(0, 4, (500, 2))
    places = places[shapely.contains_xy(room.buffer(-0.25), places[:, 0], places[:, 1])][:120]
    poses = np.column_stack([places, rng.uniform(-np.pi, np.pi, len(places))])
    walls = Landmarks(WallsConfig(housekeeping=False), 5)
    for k, scan, hit in scans(faces, poses, rng):
        segments = extract(scan)
        first, last = segments.beams.T
        beams = len(scan.ranges_m)
        runs = [hit[np.arange(a, b + 1 + beams * (b < a)) % beams] for a, b in segments.beams]
        pure = np.array([len(set(run)) == 1 for run in runs], dtype=bool)
        middle = (first + (last - first) % beams // 2) % beams
        owners = np.where(pure & ~segments.is_tentative, hit[middle], -1)
        walls.observe(belief_of(faces, poses[k]), scan, segments, owners)
    found = walls.map(belief_of(faces, poses[-1]))
    assert np.count_nonzero(found.observations > 50) > 3
    assert not found.crooked.any()


@pytest.mark.parametrize("turn_deg", [1.0, 2.0])
def test_of_two_faces_that_meet_each_is_off_the_line_through_both_by_what_is_stated(turn_deg):
    """The middle of a wall stands out; the faces beside it turn by half the bend either way."""
    rng, turn_rad = np.random.default_rng(1), np.deg2rad(turn_deg)
    faces = bent(turn_rad, half_m=0.7)
    through_both, walls = [[faces[0, 0], faces[1, 1]]], Landmarks(WallsConfig(), 5)
    poses = rng.uniform([-0.3, -1.5, -3.0], [0.3, -0.6, 3.0], (200, 3))
    for k, scan, _ in scans(faces, poses, rng):
        segments = extract(scan)
        owners, belief = np.zeros(len(segments), dtype=np.int64), belief_of(through_both, poses[k])
        walls.observe(belief, scan, segments, owners)
    stated = walls.map(belief)
    assert stated.crooked.all()
    assert np.sqrt(stated.off_line_cov[0, 0, 0]) == pytest.approx(np.tan(0.5 * turn_rad), rel=0.1)
    lack = walls.lack_of_fit(segments, owners)
    np.testing.assert_allclose(np.sqrt(lack[:, 0, 0]), np.tan(0.5 * turn_rad), rtol=0.1)


def test_clear_are_many_beams_and_a_known_direction():
    config = ReliabilityConfig()
    assert are_clear(observation(0.0, 0.5 * config.heading_rad)).all()
    assert not are_clear(observation(0.0, 2.0 * config.heading_rad)).any()
    assert not are_clear(observation(0.0, 0.01, beams=4)).any()


@pytest.mark.parametrize("middle_m", [0.5, -1.0])
def test_beside_a_clear_observation_few_beams_tell_their_distance_at_their_middle_and_no_direction(middle_m):
    """A line that beams met `middle_m` along it from the foot of the robot's perpendicular."""
    to_robot = np.array([[1.0, 0.0], [middle_m, 1.0]])  # (alpha, across at the middle) to (alpha, r)
    cov = to_robot @ np.diag([1e-6, 4e-6]) @ to_robot.T
    both = [replace(observation(0.0, 1e-3, beams, length_m=3.0), cov=cov[None]) for beams in (4, 9)]
    few = both[0]
    together = Segments(*(np.concatenate([getattr(each, name) for each in both]) for name in vars(few)))
    wide, clear = as_told(together.cov, together, FACES)
    at_middle = np.linalg.inv(to_robot)
    np.testing.assert_allclose(at_middle @ wide @ at_middle.T, np.diag([1e-6 + FACES.heading_rad**2, 4e-6]), atol=1e-12)
    np.testing.assert_array_equal(clear, cov)
    np.testing.assert_array_equal(as_told(cov[None], few, FACES), cov[None], "alone it is all that there is")


def test_a_wall_counts_as_long_as_two_scans_saw_it():
    """Two beams on a wall's end and six on a face behind it make a line of 0.6 m, once; all others show the end."""
    reliability, extents = Reliability(), np.array([[0.0, 0.6]])
    reliability._records.rows(OWNER)

    def turn_rad():
        return float(np.sqrt(reliability.off_line_cov(extents, np.zeros((1, 5)))[1][0, 0, 0]))

    reliability.see(observation(0.0, 0.01, length_m=0.6), OWNER)
    alone = turn_rad()
    for _ in range(9):
        reliability.see(observation(0.0, 0.2, length_m=0.08), OWNER)
    assert alone < np.deg2rad(1.0)
    assert np.deg2rad(4.0) < turn_rad() < np.deg2rad(6.0)
    reliability.see(observation(0.0, 0.01, length_m=0.7), OWNER)
    assert turn_rad() == pytest.approx(alone), "seen once more, it is as long as it seemed"


def test_the_longest_pieces_of_two_walls_that_are_one_are_the_longest_of_both():
    reliability = Reliability()
    reliability._records.rows(np.arange(2))
    for length, owner in ((0.3, 0), (0.9, 0), (0.5, 1), (0.2, 1)):
        reliability.see(observation(0.0, 0.01, length_m=length), np.array([owner]))
    reliability._records.merge(0, 1, 0.0)
    np.testing.assert_allclose(reliability._records.columns["longest"], [[0.5, 0.9]])


def test_a_line_over_two_faces_turns_nobody_beside_a_clear_wall():
    """Three exact beams over a bend of 5 degrees are a line, known to 0.16 degrees and 0.75 off (0.6 in heading)."""
    faces = np.array([[[0.0, 0.0], [3.0, 0.0]], [[3.0, 0.0], [4.0, 0.09]], [[8.5, 0.3], [8.5, 1.3]]])
    finder = RangeFinder(faces, LidarConfig())
    poses = np.array([[4.6, 1.0, 0.1 * k] for k in range(10)] + [[5.8, 0.69, 1.0]])
    mapper = Mapper(BACKENDS["full-ekf"].make(poses[0].copy(), 1e-8 * np.eye(3)))
    for k, pose in enumerate(poses):
        if k:
            motion = compose(inverse(poses[k - 1]), pose)
            mapper.predict(Odometry(motion, np.diag([0.02, 0.02, np.deg2rad(1.0)]) ** 2))
        update = mapper.step(Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.1 * k))
    assert 3 in update.segments.beam_counts[update.matches.pairs[:, 0]], "the line over two faces is matched"
    assert abs(update.map.belief.pose_world[2] - 1.0) < np.deg2rad(0.15)


def test_a_line_laid_down_the_stairs_is_found_out():
    """Passing to and fro before the steps: what the map says of the jamb, and where the robot believes to be."""
    rng = np.random.default_rng(3)
    x = 2.08 + 0.5 * np.sin(np.linspace(0, 8 * np.pi, 160))
    poses = np.column_stack([x, 3.2 + 0.1 * np.cos(np.linspace(0, 6 * np.pi, 160)), np.full(160, 0.5 * np.pi)])
    mapper = Mapper(BACKENDS["full-ekf"].make(poses[0].copy(), np.diag([0.01, 0.01, 0.002]) ** 2))
    errors = []
    for k, scan, _ in scans(faces_of(STEPS), poses, rng):
        if k:
            mapper.predict(Odometry(compose(inverse(poses[k - 1]), poses[k]), np.diag([0.003, 0.003, 0.002]) ** 2))
        walls = mapper.step(scan).map
        off = walls.belief.pose_world - poses[k]
        errors.append(off @ np.linalg.solve(walls.belief.pose_cov, off) / 3)
    assert 0 < np.count_nonzero(walls.crooked) < 5, "the four walls of the room are straight"
    assert np.mean(errors) < 2.0


def test_whatever_is_matched_moves_the_estimate_as_far_as_it_is_told():
    """A short face, a wall of few beams and a long wall alike: their noise says how far, and no switch beside it."""
    rng = np.random.default_rng(4)
    poses = np.column_stack([np.linspace(1.5, 2.5, 12), np.full(12, 2.6), np.full(12, 0.5 * np.pi)])
    backend = BACKENDS["full-ekf"].make(poses[0].copy(), np.diag([0.01, 0.01, 0.002]) ** 2)
    moved = []
    update = backend.update

    def overheard(first, second):
        moved.append(second.ids.tolist())
        update(first, second)

    backend.update = overheard
    mapper = Mapper(backend)
    for k, scan, _ in scans(faces_of(STEPS), poses, rng):
        if k:
            mapper.predict(Odometry(compose(inverse(poses[k - 1]), poses[k]), np.diag([0.003, 0.003, 0.002]) ** 2))
        matches = mapper.step(scan).matches
        assert sorted(moved[-1]) == sorted(matches.pairs[:, 1].tolist())
    assert max(len(ids) for ids in moved) > 4
