"""Bends that the map knows: which walls make one, and on which segments it lies."""

from functools import partial

import numpy as np
import pytest

from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import directions, through
from chainslam.slam.geometry.poses import to_robot, to_world
from chainslam.slam.map.polylines import vertices
from chainslam.slam.map.stochastic_map import StochasticMap

POSE = np.array([1.0, 2.0, 0.7])
vertices_within = partial(vertices.vertices_within, one_wall=0.9999)
meetings = partial(vertices.meetings, one_wall=0.9999)
mistaken = partial(vertices.mistaken, gate=0.99)


def map_of(ends, sigma=1e-3):
    """Return a map of walls with these ends, world frame, each anchored at its middle, and the robot at POSE.

    All is known to `sigma`, m and rad.
    """
    ends = np.array(ends, dtype=float)
    alpha, middle, n = through(ends)[:, 0], ends.mean(axis=1), len(ends)
    means = np.stack([alpha, np.zeros(n)], axis=-1)

    def query(ids):
        return Joint(np.append(POSE, means[ids].ravel()), sigma**2 * np.eye(3 + 2 * len(ids)), middle[ids])

    belief = Belief(POSE, np.eye(3), np.arange(n), middle, means, query)
    extents = np.sum((ends - middle[:, None]) * directions(alpha)[:, None], axis=-1)
    return StochasticMap(belief, extents, np.full(n, 9), np.zeros(n, dtype=bool), np.zeros(n, dtype=bool))


def segment_of(first, last):
    ends = to_robot(np.array([[first, last]], dtype=float), POSE)
    nothing = np.zeros((1, 2), dtype=np.int64)
    return Segments(
        through(ends), np.eye(2)[None], ends, nothing, np.array([9]), nothing, np.zeros(1), np.zeros(1, bool)
    )


def bent(gap=0.0, slope=0.03, aside=0.0):
    """Return two walls along y = 0, free side above, the second of which goes down by `slope`."""
    return [[[0.0, 0.0], [2.0 - gap / 2, 0.0]], [[2.0 + gap / 2, aside], [4.0, aside - slope * 2.0]]]


@pytest.mark.parametrize(
    ("walls", "is_bend"),
    [
        (bent(), True),
        (bent(gap=0.08), True),
        (bent(gap=0.2), False),
        (bent(gap=-0.4), True),
        (bent(gap=-1.2), True),
        (bent(slope=0.3), False),
        (bent(aside=-0.1), False),
        (bent()[:1], False),
        ([[[0.0, 0.0], [2.0, 0.0]], [[1.6, 0.0], [1.9, 0.0]]], False),
    ],
)
def test_where_one_wall_ends_another_begins_that_turns_little(walls, is_bend):
    """Not past a gap, nor where they turn much, lie apart, or one lies within the other; lines cross there."""
    found = vertices_within(segment_of([1.0, 0.01], [3.0, -0.02]), map_of(walls))
    assert len(found) == is_bend
    if is_bend:
        np.testing.assert_allclose(found, np.arctan2(-2.0, walls[1][0][0] - 1.0) - POSE[2], atol=1e-9)


@pytest.mark.parametrize(
    ("first", "last", "is_on"),
    [
        ([1.0, 0.0], [3.0, -0.03], True),
        ([1.0, 0.0], [2.02, 0.0], False),
        ([1.98, 0.0], [3.0, -0.03], False),
        ([1.0, 0.1], [3.0, 0.1], False),
        ([3.0, 0.0], [1.0, 0.0], False),
        ([1.85, 0.03], [2.15, -0.06], False),
    ],
)
def test_a_bend_lies_within_the_segments_that_pass_over_it(first, last, is_on):
    """Not on one that ends there, lies aside, is the other side of the wall, or crosses it."""
    assert len(vertices_within(segment_of(first, last), map_of(bent()))) == is_on


def test_what_was_cut_is_known_and_need_not_come_near_the_bend():
    """Two walls of one direction as far as the map knows, whose ends far beams have left 0.4 m apart."""
    segment, pair = segment_of([1.0, 0.0], [3.0, -0.03]), {(0, 1)}
    assert len(vertices_within(segment, map_of(bent(slope=0.001)), cut=pair)) == 1
    (bearing,) = vertices_within(segment, map_of(bent(gap=0.4, slope=0.001)), cut=pair)
    np.testing.assert_allclose(bearing, np.arctan2(-2.0, 1.2) - POSE[2], atol=1e-3)
    assert not len(vertices_within(segment, map_of(bent(gap=0.6)), cut=pair))
    assert not len(vertices_within(segment, map_of(bent(slope=0.001)), cut={(1, 2), (0, 7)}))


def test_a_wall_seen_once_makes_no_bend():
    walls = map_of(bent())
    walls.tentative[1] = True
    assert not len(vertices_within(segment_of([1.0, 0.0], [3.0, 0.0]), walls))


def test_where_walls_overlap_the_bend_is_where_their_lines_cross():
    """The first one was stretched by 1.2 m past the bend."""
    walls = map_of([[[0.0, 0.0], [3.2, 0.0]], [[2.0, 0.0], [4.0, -0.06]]])
    (bearing,) = vertices_within(segment_of([1.0, 0.01], [3.5, -0.03]), walls)
    np.testing.assert_allclose(bearing, np.arctan2(-2.0, 1.0) - POSE[2], atol=1e-9)


@pytest.mark.parametrize(("sigma", "is_known"), [(0.004, True), (0.02, False)])
def test_a_bend_that_may_be_a_straight_wall_is_not_known(sigma, is_known):
    assert len(vertices_within(segment_of([1.0, 0.0], [3.0, -0.03]), map_of(bent(), sigma))) == is_known


@pytest.mark.parametrize("turned_rad", [0.0, 2.0, -2.0])
@pytest.mark.parametrize("is_first", [True, False])
def test_the_sides_of_a_bend_that_overlap_meet_where_their_lines_cross(turned_rad, is_first):
    """In any direction, and whichever of the two has the lower id."""
    world = np.array([3.0, -1.0, turned_rad])
    ends = to_world(np.array([[[0.0, 0.0], [3.2, 0.0]], [[1.5, 0.015], [4.0, -0.06]]]), world)
    walls = map_of(ends if is_first else ends[::-1])
    (pair,), (along,) = meetings(walls, 9.0)
    assert pair.tolist() == ([0, 1] if is_first else [1, 0])
    foot = walls.belief.anchors[pair] + along[:, None] * directions(walls.belief.means[pair, 0])
    np.testing.assert_allclose(to_robot(foot, world), [[2.0, 0.0], [2.0, 0.0]], atol=3e-4)


def test_the_sides_of_a_bend_meet_in_the_middle_where_their_lines_do_not_cross():
    (pair,), (along,) = meetings(map_of([[[0.0, 0.0], [3.0, 0.0]], [[2.0, 0.01], [4.0, 0.01]]]), 9.0, cut={(0, 1)})
    assert pair.tolist() == [0, 1]
    np.testing.assert_allclose(along, [1.0, -0.5], atol=1e-9)


def test_the_sides_of_a_bend_that_end_before_it_are_left_as_they_are():
    assert not len(meetings(map_of(bent(gap=0.1)), 9.0, cut={(0, 1)})[0])
    assert not len(meetings(map_of(bent(gap=-0.02)), 9.0)[0])


@pytest.mark.parametrize(("slope", "sigma"), [(0.003, 1e-5), (0.03, 0.02), (0.04, 1e-5)])
def test_walls_that_may_be_one_or_no_wall_do_not_end_where_their_lines_cross(slope, sigma):
    """They turn too little, or so much that beams tell them apart, or it is not known that they turn."""
    ends = [[[0.0, 0.0], [3.2, 0.0]], [[1.5, 0.5 * slope], [4.0, -2.0 * slope]]]
    assert not len(meetings(map_of(ends, sigma), 9.0)[0])
    assert len(meetings(map_of(ends, sigma), 9.0, cut={(0, 1)})[0])


def test_where_lines_cross_just_outside_the_overlap_one_wall_is_left_as_it_is():
    walls = map_of([[[0.0, 0.0], [3.0, 0.0]], [[2.05, -0.0015], [4.0, -0.06]]])
    (pair,), (along,) = meetings(walls, 9.0)
    foot = walls.belief.anchors[pair] + along[:, None] * directions(walls.belief.means[pair, 0])
    np.testing.assert_allclose(foot[:, 0], [2.05, 2.05], atol=1e-3)


def scan_of(*ends, sigma_rad=0.002, beams=9):
    """Return what the robot at POSE sees: segments with these ends, world frame, counter-clockwise."""
    ends, n = to_robot(np.reshape(ends, (-1, 2, 2)).astype(float), POSE), len(ends)
    nothing = np.zeros((n, 2), dtype=np.int64)
    cov = np.tile(np.diag([sigma_rad**2, 1e-6]), (n, 1, 1))
    return Segments(through(ends), cov, ends, nothing, np.full(n, beams), nothing, np.zeros(n), np.full(n, beams < 5))


BENT = ([1.0, 0.0], [2.0, 0.0]), ([2.1, -0.005], [3.0, -0.055])
"""Two sides of a bend of 3 degrees, 0.1 m apart."""


@pytest.mark.parametrize("shift", [0, 1])
def test_a_wall_laid_across_a_bend_that_the_scan_shows_was_none(shift):
    """Whichever segment comes first; not one that ends at the bend, lies aside, or was seen often."""
    ends = [
        *([[1.0, 0.0], [3.0, -0.05]], [[0.0, 0.0], [2.2, 0.0]], [[2.0, 0.0], [4.0, -0.1]], [[0.0, 0.2], [4.0, 0.2]]),
        *([[0.0, 0.0], [4.0, -0.02]], [[4.0, 0.0], [0.0, 0.0]], [[1.0, 0.5], [3.0, -0.5]]),
    ]
    walls = map_of(ends)
    walls.observations[4] = 50
    others = ([4.0, -0.1], [4.0, 3.0]), ([4.0, 3.0], [0.0, 3.0])
    assert mistaken(scan_of(*np.roll([*BENT, *others], shift, axis=0)), walls).tolist() == [0]


@pytest.mark.parametrize(
    "scan",
    [
        scan_of(*BENT, sigma_rad=0.02),
        scan_of(*BENT, beams=4),
        scan_of(BENT[0], ([2.6, -0.03], [3.0, -0.05])),
        scan_of(BENT[0], ([2.1, -0.005], [3.0, -0.7])),
        scan_of(([0.0, 0.0], [4.0, 0.0])),
        scan_of(),
    ],
)
def test_where_the_scan_may_show_one_wall_or_two_with_a_gap_nothing_was_mistaken(scan):
    """The turn is in doubt, by noise or by few beams; there is a gap, a real corner, or only one segment, or none."""
    assert not len(mistaken(scan, map_of([[[1.0, 0.0], [3.0, -0.05]]])))
