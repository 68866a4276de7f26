"""Walls of second looks: where they stand and how far they reach, and which are one."""

from dataclasses import replace

import numpy as np

from chainslam.slam.association.second_looks.closures import Closure
from chainslam.slam.association.second_looks.landmarks import firm, joined
from chainslam.slam.association.second_looks.loop_search import LoopSearch
from chainslam.slam.association.second_looks.second_looks import _with_walls, second_looks
from chainslam.slam.association.second_looks.solve import begun
from chainslam.slam.association.second_looks.submaps import Returns
from chainslam.slam.association.second_looks.walls import merged, spans
from chainslam.slam.geometry.poses import compose, inverse
from tests.slam.association.drives import driven
from tests.slam.association.test_second_looks import CONFIG, WALLS, drive, problem, segments_at


def test_walls_stand_where_the_room_has_them_and_reach_as_far():
    _, drifted, motions, segments = drive()
    survey = second_looks(drifted[0], driven(motions), segments, [np.zeros((0, 2))] * len(drifted))
    assert len(survey.walls) == len(WALLS)
    ends = survey.walls.ends_world
    for wall in WALLS:
        assert np.abs(ends - wall).max(axis=(1, 2)).min() < 0.03
    np.testing.assert_array_equal(survey.walls.observations, 60)
    np.testing.assert_allclose(survey.walls.belief.pose_world, survey.poses[-1])
    cov = survey.joint.cov
    np.testing.assert_allclose(survey.walls.belief.joint([1]).cov, cov[np.ix_([0, 1, 2, 5, 6], [0, 1, 2, 5, 6])])
    assert np.linalg.eigvalsh(cov).min() > 0.0
    assert np.all(np.diag(cov)[4::2] >= CONFIG.floor_m**2)


def test_walls_that_stand_twice_become_one_and_the_other_side_stays():
    true, _, _, sightings, owner = problem()
    twice = np.where((owner == 0) & (sightings.scan > 3), owner.max() + 1, owner)
    start = begun(true, sightings, twice)
    once = merged(start, spans(start, sightings, twice), twice, CONFIG)
    assert len(np.unique(once)) == len(np.unique(owner))
    for line in np.unique(owner):
        assert len(np.unique(once[owner == line])) == 1
    apart = begun(true, sightings, owner)
    np.testing.assert_array_equal(merged(apart, spans(apart, sightings, owner), owner, CONFIG), owner)


def test_one_segment_that_runs_on_makes_no_wall_longer():
    true, _, _, sightings, owner = problem()
    start = begun(true, sightings, owner)
    before = spans(start, sightings, owner)
    long = sightings.ends.copy()
    row = int(np.flatnonzero(owner == 1)[3])
    long[row, 1] += 2.0 * (long[row, 1] - long[row, 0])
    after = spans(start, replace(sightings, ends=long), owner)
    np.testing.assert_allclose(after, before, atol=0.03)


def test_the_two_faces_of_a_thin_wall_and_pieces_apart_on_one_line_stay_walls_of_their_own():
    true, _, _, _ = drive(4)
    walls = np.array([[[2, 1], [4, 1]], [[4, 1.1], [2, 1.1]], [[6, 1], [8, 1]]], float)
    rng = np.random.default_rng(0)
    sightings = joined([firm(k, segments_at(pose, rng, walls), CONFIG) for k, pose in enumerate(true)])
    owner = np.tile([0, 1, 2], 4)
    start = begun(true, sightings, owner)
    np.testing.assert_array_equal(merged(start, spans(start, sightings, owner), owner, CONFIG), owner)


def test_pieces_of_a_wall_that_later_scans_join_are_one_wall_in_the_end():
    true, drifted, motions, segments = drive(30)
    rng = np.random.default_rng(2)
    whole, left, right = (
        np.array([[a, b]], float) for a, b in (([6, 0], [0, 0]), ([6, 0], [3.5, 0]), ([2.5, 0], [0, 0]))
    )
    shown = [left] * 8 + [right] * 8 + [whole] * 14
    segments = [
        segments_at(pose, rng, np.concatenate([wall, WALLS[1:]])) for pose, wall in zip(true, shown, strict=True)
    ]
    survey = second_looks(drifted[0], driven(motions), segments, [np.zeros((0, 2))] * len(true))
    assert len(survey.walls) == len(WALLS)


def test_a_closure_that_only_walls_contradict_is_taken_back():
    true, _, motions, segments = drive()
    wrong = compose(inverse(true[5]), true[35]) + np.array([0.0, 0.6, 0.0])
    search = LoopSearch(true[0], driven(motions), Returns([np.zeros((0, 2))] * len(true), CONFIG.closures), CONFIG)
    search.closures.append(Closure(5, 35, wrong))
    sightings = joined([firm(k, each, CONFIG) for k, each in enumerate(segments)])
    survey = _with_walls(search, sightings, CONFIG)
    assert survey.closures == 0
    assert np.hypot(*(survey.poses - true)[:, :2].T).max() < 0.02
