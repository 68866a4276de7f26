"""What becomes of a wall's extent, and of the wall, scan by scan: beams through it, looks."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.extraction.extract import extract
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.map.extents import WallsConfig
from chainslam.slam.map.landmarks import Landmarks
from chainslam.slam.robot import Scan

SETTINGS = (WallsConfig(), 5)
CONFIG = WallsConfig()


def belief_of(faces, pose):
    """Return a belief in the lines of these faces (free side on the left), anchored in their middles."""
    faces = np.asarray(faces, dtype=float)
    lines, anchors = through(faces), faces.mean(axis=1)
    means = np.column_stack([lines[:, 0], lines[:, 1] - np.vecdot(normals(lines[:, 0]), anchors)])
    mean = np.concatenate([pose, means.ravel()])
    return Belief(
        np.asarray(pose), 1e-6 * np.eye(3), np.arange(len(faces)), anchors, means,
        lambda ids: Joint(mean, 1e-6 * np.eye(len(mean)), anchors),
    )  # fmt: skip


def scan_of(faces, pose):
    finder = RangeFinder(np.asarray(faces, dtype=float).reshape(-1, 2, 2), LidarConfig())
    return Scan(finder.bearings_rad, finder.cast(np.asarray(pose))[0], 0.01, 4.0, 0.0)


def see(walls, known, shown, owners, pose):
    """Let the walls, lines through the faces `known`, see a scan of the faces `shown`; return the ids forgotten."""
    scan = scan_of(shown, pose)
    segments = extract(scan)
    assert len(segments) == len(owners)
    observed = walls.observe(belief_of(known, pose), scan, segments, np.array(owners, dtype=np.int64))
    return observed.forgotten.tolist()


BEFORE_BEND = [[0.0, 0.0], [2.0, 0.0]]
WALL, BEHIND, FARTHER_BEHIND = ([[2.0 + behind, -1.0], [2.0 + behind, 1.0]] for behind in (0.0, 0.03, 0.05))
"""Seen from the origin: a beam that ends on the wall shows nothing of what lies more than 4 cm behind it."""


@pytest.mark.parametrize(("behind", "observations", "is_kept"),
                         [(BEHIND, 1, False), (BEHIND, 5, True), (FARTHER_BEHIND, 1, True)])  # fmt: skip
def test_a_wall_in_whose_place_another_is_seen_from_several_places_is_forgotten(behind, observations, is_kept):
    """Not after two looks where five spoke for it, nor where the other may hide it."""
    walls, known = Landmarks(*SETTINGS), [WALL, behind]
    poses = [[0.0, 0.1 * (k % 2), 0.0] for k in range(12)]
    for pose in poses:
        see(walls, [WALL], [WALL], [0], pose)
    for pose in poses[:observations]:
        assert see(walls, known, [behind], [1], pose) == []
    forgotten = [see(walls, known, [WALL], [0], pose) for pose in poses[:2]]
    assert forgotten == [[], [] if is_kept else [1]]


def test_of_two_walls_that_are_one_the_surer_tells_how_likely_it_is():
    walls, known = Landmarks(*SETTINGS), [WALL, BEHIND]
    for k in range(4):
        see(walls, [WALL], [WALL], [0], [0.0, 0.1 * k, 0.0])
    see(walls, known, [BEHIND], [1], [0.0, 0.4, 0.0])
    belief = belief_of(known, ORIGIN)
    assert walls.map(belief).tentative.tolist() == [False, True]
    walls.merge(belief, 1, 0)
    assert walls.map(belief_of([BEHIND], ORIGIN)).tentative.tolist() == [False]


def test_a_wall_is_kept_where_none_are_forgotten():
    walls = Landmarks(replace(CONFIG, housekeeping=False), *SETTINGS[1:])
    see(walls, [WALL], [WALL], [0], ORIGIN)
    for k in range(10):
        assert see(walls, [WALL, ELSEWHERE], [ELSEWHERE], [1], [0.0, 0.1 * (k % 2), 0.0]) == []


FRONT = [[1.0, -1.0], [1.0, 1.0]]
"""Seen from the origin by a beam every 3.5 to 7 cm."""
ELSEWHERE = [[-4.0, -1.0], [-2.0, -1.0]]
ORIGIN, AWAY = [0.0, 0.0, 0.0], [-3.5, 0.0, 0.0]
"""From `AWAY` the wall in front is out of range."""


def extent_of(walls, known, pose=ORIGIN):
    """Return from where to where along y the first wall reaches, m."""
    return walls.map(belief_of(known, pose)).ends_world[0, :, 1].tolist()


def test_a_wall_seen_once_is_tentative_and_kept_where_no_look_reaches_it():
    walls = Landmarks(*SETTINGS)
    for observations in (1, 2):
        see(walls, [FRONT], [FRONT], [0], ORIGIN)
        assert walls.map(belief_of([FRONT], ORIGIN)).tentative.tolist() == [observations < 2]
    assert not any(see(walls, [FRONT, ELSEWHERE], [ELSEWHERE], [1], AWAY) for _ in range(20))


def with_a_hole(low, high):
    """Return the wall in front with a hole from `low` to `high` along it, m."""
    return [[[1.0, -1.0], [1.0, low]], [[1.0, high], [1.0, 1.0]]]


def test_a_wall_is_cut_back_to_its_last_hit_once_two_scans_in_turn_show_beams_behind_it():
    walls = Landmarks(*SETTINGS)
    see(walls, [FRONT], [FRONT], [0], ORIGIN)
    whole = extent_of(walls, [FRONT])
    for _ in range(2):  # what one scan shows, and the next does not, is a fault of it
        see(walls, [FRONT], with_a_hole(0.3, 0.9), [0], ORIGIN)
        assert extent_of(walls, [FRONT]) == whole
        see(walls, [FRONT], [FRONT], [0], ORIGIN)
    for _ in range(2):
        see(walls, [FRONT], with_a_hole(0.3, 0.9), [0], ORIGIN)
    low, high = extent_of(walls, [FRONT])
    assert low == whole[0]
    assert 0.25 < high <= 0.3


def test_beams_beside_its_end_cut_no_wall():
    """Two beams pass within 0.1 m of the end: ends and corners are known no better."""
    walls, pose = Landmarks(*SETTINGS), [0.0, 0.8, 0.0]
    see(walls, [FRONT], [FRONT], [0], pose)
    whole = extent_of(walls, [FRONT], pose)
    for _ in range(4):
        see(walls, [FRONT], [[[1.0, -1.0], [1.0, 0.86]]], [0], pose)
    assert extent_of(walls, [FRONT], pose) == whole


@pytest.mark.parametrize("beside_m", [0.0, 0.0175])
@pytest.mark.parametrize("length_m", [0.12, 0.16, 0.19])
def test_what_is_as_short_as_a_leg_goes_once_beams_pass_where_it_stood(length_m, beside_m):
    """Each point of it lies within 0.1 m of an end, and no beam need pass its very middle.

    Something that stands in its place keeps it.
    """
    pose, leg = [0.0, beside_m, 0.0], [[1.0, -0.5 * length_m], [1.0, 0.5 * length_m]]
    behind = [[3.0, -2.0], [3.0, 2.0]]
    for shown, owner in ((behind, -1), (leg, 0)):
        walls = Landmarks(*SETTINGS)
        gone = [see(walls, [leg], [each], [of], pose) for each, of in [(leg, 0), *[(shown, owner)] * 6]]
        assert any(gone) == (owner < 0)


def test_a_corner_seen_more_sharply_moves_the_end_back():
    """From 2 m, at a grazing angle, beams stand 0.2 m apart on the wall: its corner is known no better."""
    walls, far, near = Landmarks(*SETTINGS), [0.1, 0.5, 0.0], [1.6, 0.5, 0.0]
    side = [[2.0, 0.0], [2.0, 1.5]]
    see(walls, [BEFORE_BEND], [[[0.0, 0.0], [2.05, 0.0]], [[2.05, 0.0], [2.05, 1.5]]], [0, -1], far)
    assert walls.map(belief_of([BEFORE_BEND], far)).ends_world[0, 1, 0] == pytest.approx(2.05, abs=1e-3)
    see(walls, [BEFORE_BEND], [BEFORE_BEND, side], [0, -1], near)
    assert walls.map(belief_of([BEFORE_BEND], near)).ends_world[0, 1, 0] == pytest.approx(2.0, abs=1e-3)
    see(walls, [BEFORE_BEND], [[[0.0, 0.0], [1.95, 0.0]], [[1.95, 0.0], [1.95, 1.5]]], [0, -1], far)
    assert walls.map(belief_of([BEFORE_BEND], far)).ends_world[0, 1, 0] == pytest.approx(2.0, abs=1e-3)


@pytest.mark.parametrize(("length_m", "is_kept"), [(0.04, False), (0.06, True)])
def test_a_wall_shorter_than_its_ends_are_known_is_none(length_m, is_kept):
    walls, pose, face = Landmarks(*SETTINGS), [0.8, 0.0, 0.0], [[1.0, -0.5 * length_m], [1.0, 0.5 * length_m]]
    scan = scan_of([face], pose)
    segments = extract(scan)
    assert len(segments) == 1
    segments.ends[0, :, 1] = [-0.5 * length_m, 0.5 * length_m]
    forgotten = walls.observe(belief_of([face], pose), scan, segments, np.zeros(1, dtype=np.int64)).forgotten
    assert forgotten.tolist() == ([] if is_kept else [0])
