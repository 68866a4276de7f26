"""Where a map lies in a saved one: what holds a place, and which places a drive leaves."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.association.second_looks import placement
from chainslam.slam.association.second_looks.agreement import Agreement, Walls
from chainslam.slam.association.second_looks.placement import Placement, placements, possible
from chainslam.slam.association.second_looks.refuted import Rays, refuted, voted
from chainslam.slam.association.second_looks.solve import Unknowns
from chainslam.slam.geometry.lines import directions, through
from chainslam.slam.geometry.poses import inverse, to_world, wrap
from chainslam.slam.robot import Scan, ScannerSpec
from tests.slam.extraction.test_extract import loop

CROOKED = loop((0, 0), (6, 0), (6, 2), (4.5, 2), (4.5, 4.2), (2, 4.2), (2, 3), (0, 3))
LONG = loop((0, 0), (6, 0), (6, 4), (0, 4))
OTHER = loop((0, 0), (9, 0), (9, 1.7), (5, 1.7), (5, 7), (3.2, 7), (3.2, 1.7), (0, 1.7))
PLACE = np.array([2.0, -1.0, 0.8])
GOOD = Placement(np.zeros(3), np.eye(3), 10, 17.0, 9.0, 1.0)


@pytest.mark.parametrize(
    ("change", "holds"),
    [
        ({}, True),
        ({"pairs": 2, "chi2": 0.5}, True),
        ({"pairs": 1, "chi2": 0.0}, False),
        ({"pro_m": 7.6, "contra_m": 2.5}, True),
        ({"pro_m": 7.4, "contra_m": 2.5}, False),
        ({"pro_m": 6.7, "contra_m": 0.0}, True),
        ({"pro_m": 6.6, "contra_m": 0.0}, False),
        ({"chi2": 40.3}, True),
        ({"chi2": 41.2}, False),
    ],
)
def test_a_place_explains_a_third_contradicts_a_quarter_and_its_walls_fit_together(change, holds):
    assert replace(GOOD, **change).holds(20.0) == holds


def walls_of(faces):
    """Return faces as the walls of a map, with anchors amid them."""
    lines, middle = through(faces), faces.mean(axis=1)
    t = directions(lines[:, 0])
    return Walls(
        middle, np.column_stack([lines[:, 0], np.zeros(len(faces))]),
        np.vecdot(faces - middle[:, None], t[:, None]), 1e-4 * np.eye(2 * len(faces)),
    )  # fmt: skip


def driven(faces, ways, place):
    """Return a map of faces in the frame of `place`, and the poses and scans of a drive there."""
    finder, back = RangeFinder(faces, LidarConfig(range_max_m=12.0)), inverse(place)
    poses = np.array([[x, y, heading] for x, y in ways for heading in np.arange(-3.0, 3.0, 1.0)])
    scans = [Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 12.0, 0.1 * k) for k, pose in enumerate(poses)]
    own = np.column_stack([to_world(poses[:, :2], back), wrap(poses[:, 2] + back[2])])
    return walls_of(to_world(faces, back)), own, Rays(scans, ScannerSpec())


WAYS = [(1.0, 1.0), (2.0, 1.2), (3.0, 1.3), (4.0, 1.2), (3.2, 2.4), (3.2, 3.4)]


def test_a_map_lies_where_it_was_made():
    (found,) = placements(walls_of(CROOKED), *driven(CROOKED, WAYS, PLACE))
    np.testing.assert_allclose(found.place, PLACE, atol=1e-3)
    assert found.pairs == len(CROOKED)
    assert found.contra_m == 0.0


def test_in_a_room_that_looks_the_same_turned_by_half_a_turn_there_are_two_places():
    found = placements(walls_of(LONG), *driven(LONG, [(1.0, 1.0), (3.0, 2.0), (4.5, 2.5)], PLACE))
    assert len(found) == 2
    assert abs(wrap(found[0].place[2] - found[1].place[2])) == pytest.approx(np.pi, abs=1e-3)


@pytest.mark.parametrize(("depth_m", "places"), [(0.2, 2), (0.4, 1)])
def test_a_niche_that_is_no_deeper_than_maps_bend_leaves_a_room_alike_after_half_a_turn(depth_m, places):
    niche = loop((0, 0), (6, 0), (6, 4), (4.5, 4), (4.5, 4 + depth_m), (1.5, 4 + depth_m), (1.5, 4), (0, 4))
    ways = [(1.0, 1.0), (3.0, 2.0), (4.5, 2.5), (3.0, 3.5 + 0.5 * depth_m)]
    found = placements(walls_of(niche), *driven(niche, ways, PLACE))
    assert len(found) == places
    assert min(np.abs(each.place - PLACE).max() for each in found) < 1e-3


def test_a_place_is_possible_too_for_which_seven_tenths_as_much_speaks():
    best, near, far = (replace(GOOD, pro_m=each, contra_m=0.0) for each in (20.0, 14.1, 13.9))
    refused = replace(best, pairs=1)
    assert possible([far, near, refused, best], 20.0) == [best, near]
    assert possible([refused], 20.0) == []


def test_another_building_has_no_place_for_it():
    ways = [(1.0, 0.8), (2.5, 0.9), (4.1, 0.9), (4.1, 3.0), (4.1, 5.5), (7.0, 0.9)]
    assert placements(walls_of(CROOKED), *driven(OTHER, ways, PLACE)) == []


def test_a_map_without_walls_has_no_place():
    own, poses, rays = driven(CROOKED, WAYS, PLACE)
    nothing = Walls(np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 0)))
    assert placements(nothing, own, poses, rays) == []
    assert placements(own, nothing, poses, rays) == []


def test_a_scan_votes_for_a_wall_on_which_its_beams_end_and_against_one_that_they_pass():
    finder = RangeFinder(np.array([[[4.0, 3.0], [4.0, -3.0]]])[:, ::-1], LidarConfig(range_max_m=12.0))
    scan = Scan(finder.bearings_rad, finder.cast(np.zeros(3))[0], 0.01, 12.0, 0.0)
    lines = np.array([[0.0, 4.0], [0.0, 2.0], [0.0, 6.0]])
    at, reach = Unknowns(np.zeros((3, 3)), lines, np.zeros((3, 2))), np.tile([-1.5, 1.5], (3, 1))
    pro, contra = voted(at, reach, Rays([scan] * 3, ScannerSpec()), 0.1)
    assert (pro.tolist(), contra.tolist()) == ([3, 0, 0], [0, 3, 0])
    assert refuted(at, reach, Rays([scan] * 3, ScannerSpec()), 0.1).tolist() == [False, True, False]


def test_a_vote_of_a_single_scan_tells_nothing():
    _, poses, rays = driven(CROOKED, WAYS[:1], PLACE)
    one = Rays(rays.scans[:1], rays.scanner)
    rated = placement._rated(walls_of(CROOKED), Placement(PLACE, np.eye(3)), poses[:1], one)
    assert (rated.pro_m, rated.contra_m) == (0.0, 0.0)
    both = placement._rated(
        walls_of(CROOKED), Placement(PLACE, np.eye(3)), poses[:2], Rays(rays.scans[:2], rays.scanner)
    )
    assert both.pro_m > 0.0


def test_stretches_are_evenly_spread_along_the_path_however_slowly_it_was_driven():
    x = np.concatenate([np.full(50, 0.0), np.linspace(0.0, 16.0, 1601)])
    poses = np.column_stack([x, np.zeros((len(x), 2))])
    np.testing.assert_allclose(poses[placement._stretches(poses), 0], np.arange(16) + 0.5, atol=0.02)


def test_a_stretch_without_walls_nearby_proposes_nothing():
    saved = walls_of(CROOKED)
    assert placement._proposed(saved, saved, np.array([[90.0, 0.0, 0.0]])) == ([], [])
    assert len(placement._proposed(saved, saved, np.array([[1.0, 1.0, 0.0]]))[1])


def test_a_place_is_known_at_first_as_the_pose_that_found_it(monkeypatch):
    """To a cell and a step there: the frame's origin, 30 m away, by its lever."""
    saved, asked = walls_of(CROOKED), []
    monkeypatch.setattr(placement, "agreed", lambda *given: asked.append(given) or Agreement(*given[2:], 0, 0.0))
    place, at = np.array([-30.0, 0.0, 0.0]), np.array([31.0, 1.0, 0.0])
    own = walls_of(to_world(CROOKED, inverse(place)))
    found = placement._settled(saved, own, place, at, placement._field(saved))
    np.testing.assert_allclose(found.place, place, atol=0.02)
    ((_, _, _, cov),) = asked
    move = np.eye(3)
    move[:2, 2] = [-1.0, 31.0]
    np.testing.assert_allclose(move @ cov @ move.T, np.diag([0.1, 0.1, placement.FINE.step_rad]) ** 2, atol=1e-6)
