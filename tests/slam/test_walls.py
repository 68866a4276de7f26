"""What becomes of a wall's extent, and of the wall, scan by scan: corners before its end, beams that others take."""

import numpy as np
import pytest

from sim.lidar import LidarConfig, RangeFinder
from slam.backend import Belief, Joint
from slam.extraction import extract
from slam.geometry.lines import normals, through
from slam.robot import Scan
from slam.walls import Walls, WallsConfig

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
    finder = RangeFinder(np.asarray(faces, dtype=float), LidarConfig())
    return Scan(finder.bearings_rad, finder.cast(np.asarray(pose))[0], 0.01, 4.0, 0.0)


def see(walls, known, shown, owners, pose):
    """Let the walls, lines through the faces `known`, see a scan of the faces `shown`; return the ids forgotten."""
    scan = scan_of(shown, pose)
    segments = extract(scan)
    assert len(segments) == len(owners)
    forgotten = walls.see(belief_of(known, pose), scan, segments, np.array(owners), np.zeros(0, dtype=np.int64))
    return forgotten.tolist()


BEFORE_BEND = [[0.0, 0.0], [2.0, 0.0]]
BEYOND_BEND = [[2.0, 0.0], [3.5, 0.26]]
TAKEN_FOR_STRAIGHT = [[0.0, 0.0], [2.6, 0.0]]


@pytest.mark.parametrize("mirrored", [False, True])
def test_an_end_past_a_corner_moves_back_once_two_scans_in_turn_show_the_next_wall_there(mirrored):
    """From afar the two sides of a bend of 10 degrees are one wall, which then reaches 0.6 m past the corner."""

    def laid(face):
        return [[3.5 - x, y] for x, y in reversed(face)] if mirrored else face

    pose = [1.7 if mirrored else 1.8, 1.0, 0.0]
    before, beyond, straight = laid(BEFORE_BEND), laid(BEYOND_BEND), laid(TAKEN_FOR_STRAIGHT)
    both, owners = ([beyond, before], [1, 0]) if mirrored else ([before, beyond], [0, 1])
    side, outward = (0, -1.0) if mirrored else (1, 1.0)

    def reaches_past(walls):
        end = walls.map(belief_of([before, beyond][: len(walls._ids)], pose)).ends_world[0, side]
        return outward * (end - before[side])[0]

    walls = Walls()
    see(walls, [before], [straight], [0], pose)
    assert reaches_past(walls) > 0.4
    see(walls, [before, beyond], both, owners, pose)
    assert reaches_past(walls) > 0.4
    see(walls, [before, beyond], [straight], [0], pose)  # in between one scan shows none: the count begins anew
    see(walls, [before, beyond], both, owners, pose)
    assert reaches_past(walls) > 0.4
    see(walls, [before, beyond], both, owners, pose)
    assert abs(reaches_past(walls)) < 0.02


WALL, BEHIND = [[2.0, -1.0], [2.0, 1.0]], [[2.05, -1.0], [2.05, 1.0]]
"""Seen from the origin."""


@pytest.mark.parametrize(("sightings", "claimed_after"), [(1, CONFIG.claims), (5, CONFIG.claims), (10, None)])
def test_a_wall_all_of_whose_beams_another_takes_is_forgotten_unless_it_was_seen_often(sightings, claimed_after):
    pose, walls = [0.0, 0.0, 0.0], Walls()
    for _ in range(CONFIG.established_sightings):
        see(walls, [WALL], [WALL], [0], pose)
    for _ in range(sightings):
        assert see(walls, [WALL, BEHIND], [BEHIND], [1], pose) == []
    known = [WALL, BEHIND]
    forgotten = [see(walls, known, [WALL], [0], pose) for _ in range(CONFIG.claims)]
    assert forgotten == [[]] * (CONFIG.claims - 1) + [[] if claimed_after is None else [1]]


def test_a_wall_seen_in_between_is_not_claimed():
    pose, walls = [0.0, 0.0, 0.0], Walls()
    see(walls, [WALL], [WALL], [0], pose)
    for _ in range(4):
        assert see(walls, [WALL, BEHIND], [BEHIND], [1], pose) == []
        for _ in range(CONFIG.claims - 1):
            assert see(walls, [WALL, BEHIND], [WALL], [0], pose) == []
