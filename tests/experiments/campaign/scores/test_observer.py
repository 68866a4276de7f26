"""What a campaign notes of each step: moments, marks, and what became of every segment, in a room of four walls."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.campaign.scores.observer import (
    EVERY_M,
    MARKS_M,
    NEAR_M,
    OVERLAP_M,
    Fate,
    Observer,
    _lying_on,
    association_counts,
)
from chainslam.experiments.scoring.association import Votes
from chainslam.experiments.scoring.beam_votes import UNLABELLED, vote
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.lines import through
from chainslam.slam.geometry.poses import inverse, to_world
from tests.experiments.by_hand import step_of, true_map

SQUARE = np.array([[[0, 0], [5, 0]], [[5, 0], [5, 5]], [[5, 5], [0, 5]], [[0, 5], [0, 0]]], dtype=float)
IDS = np.array([2, 3, 7, 8])
POSE = np.array([2.0, 1.0, 0.6])
BEAMS = 36


def segments_of(ends_world, beams, counts=None, pose=POSE):
    """Segments with these ends, seen from the pose with these beams."""
    ends = to_world(np.asarray(ends_world, dtype=float), inverse(pose))
    n = len(ends)
    counts = np.full(n, 9) if counts is None else np.array(counts)
    return Segments(through(ends), np.tile(1e-6 * np.eye(2), (n, 1, 1)), ends, np.array(beams).reshape(-1, 2), counts,
                    np.zeros((n, 2), bool), np.zeros(n), counts < 5)  # fmt: skip


@pytest.fixture
def walls(make_map):
    return make_map(SQUARE, POSE.copy(), ids=IDS.copy())


@pytest.fixture
def truth(world, make_map, make_chains):
    return true_map(world, make_map, make_chains).votes.truth


def step(walls, index=1, path_m=0.0, segments=None, owners=()):
    segments = segments_of(np.zeros((0, 2, 2)), np.zeros((0, 2), int)) if segments is None else segments
    changes = {"segments": segments, "walls_of_segments": np.array(owners, dtype=np.int64)}
    return step_of(walls, (), index=index, path_length_m=path_m, **changes)


def test_moments_are_taken_every_two_metres_and_marks_at_ten_twenty_and_thirty_three(walls, truth):
    assert (EVERY_M, MARKS_M) == (2.0, (10.0, 20.0, 33.0))
    observer = Observer(truth.walls, lambda index: np.zeros(BEAMS, int))
    path = [0.0, 1.9, 2.0, 3.9, 4.5, 6.1, 9.99, 10.0, 10.5, 20.3, 21.0, 40.0]
    for index, metres in enumerate(path):
        observer(step(walls, index, metres))
    taken = [0.0]
    for metres in path[1:]:
        if metres >= 2.0 * len(taken):
            taken.append(metres)
    assert [moment.path_length_m for moment in observer.moments] == taken
    assert [moment.index for moment in observer.moments] == [path.index(metres) for metres in taken]
    assert {mark: (moment.index, moment.path_length_m) for mark, moment in observer.marks.items()} == {
        10.0: (7, 10.0), 20.0: (9, 20.3), 33.0: (11, 40.0),
    }  # fmt: skip
    assert all(moment.joint is None for moment in observer.moments)
    for moment in observer.marks.values():
        np.testing.assert_array_equal(moment.joint.mean, walls.belief.joint(IDS).mean)


def test_a_moment_is_a_copy_that_a_back_end_leaves_alone(walls, truth):
    observer = Observer(truth.walls, lambda index: np.zeros(BEAMS, int))
    observer(step(walls, path_m=10.0))
    moment = observer.marks[10.0]
    before = {name: getattr(moment.map, name).copy() for name in ("extents", "observations", "tentative", "crooked")}
    held = {
        name: getattr(moment.map.belief, name).copy() for name in ("pose_world", "pose_cov", "ids", "anchors", "means")
    }
    for name in before:
        np.testing.assert_array_equal(before[name], getattr(walls, name))
        getattr(walls, name)[:] = 1
    for name in held:
        np.testing.assert_array_equal(held[name], getattr(walls.belief, name))
        getattr(walls.belief, name)[:] = 77
    for name, values in before.items():
        np.testing.assert_array_equal(getattr(moment.map, name), values)
    for name, values in held.items():
        np.testing.assert_array_equal(getattr(moment.map.belief, name), values)


def test_a_back_end_that_cannot_tell_leaves_a_mark_without_a_joint(walls, truth):
    def broken(ids) -> Joint:
        raise RuntimeError("singular")

    observer = Observer(truth.walls, lambda index: np.zeros(BEAMS, int))
    observer(step(replace(walls, belief=replace(walls.belief, query=broken)), path_m=11.0))
    assert observer.marks[10.0].joint is None


FACES = np.full(BEAMS, -1)
FACES[0:10], FACES[10:20], FACES[20:24], FACES[34:36] = 0, 1, 2, 0


def fates_of(walls, truth, segments, owners, faces=FACES):
    observer = Observer(truth.walls, {3: faces, 2: FACES}.__getitem__)
    observer(step(walls, 2, segments=segments, owners=owners))
    assert observer.fates == [], "nothing was known before the first scan"
    observer(step(walls, 3, segments=segments, owners=owners))
    return observer.fates


def test_each_segment_that_was_seen_well_on_one_wall_has_its_fate(walls, truth):
    segments = segments_of(
        [[[1.0, 0.0], [3.0, 0.0]], [[5.0, 1.0], [5.0, 4.0]], [[4.0, 5.0], [1.0, 5.0]], [[2.2, 2.8], [2.2, 2.2]]],
        [[0, 9], [10, 19], [24, 30], [20, 23]],
    )
    assert fates_of(walls, truth, segments, [2, 5, 7, -1]) == [
        Fate(2, True, int(truth.walls[0]), (2,)),
        Fate(5, False, int(truth.walls[1]), (3,)),
        # The third hit nothing that is known, the fourth lies on no line of the map.
        Fate(-1, False, int(truth.walls[2]), ()),
    ]


def test_segments_of_few_beams_have_no_fate(walls, truth):
    segments = segments_of([[[1.0, 0.0], [3.0, 0.0]], [[5.0, 1.0], [5.0, 4.0]]], [[0, 9], [10, 19]], counts=[4, 5])
    assert [fate.owner for fate in fates_of(walls, truth, segments, [2, 3])] == [3]
    none = segments_of([[[1.0, 0.0], [3.0, 0.0]]], [[0, 9]], counts=[4])
    assert fates_of(walls, truth, none, [2]) == []


@pytest.mark.parametrize(("others", "told"), [(2, True), (3, False)])
def test_a_segment_is_of_one_wall_by_four_fifths_of_all_its_beams(walls, truth, others, told):
    faces = FACES.copy()
    faces[:others] = 1
    segments = segments_of([[[1.0, 0.0], [3.0, 0.0]]], [[0, 9]])
    assert bool(fates_of(walls, truth, segments, [2], faces)) == told
    faces[:others] = -1
    assert bool(fates_of(walls, truth, segments, [2], faces)) == told


def test_a_segment_across_the_seam_is_told_by_its_own_beams(walls, truth):
    segments = segments_of([[[1.0, 0.0], [3.0, 0.0]], [[1.0, 0.0], [3.0, 0.0]]], [[34, 9], [9, 34]])
    assert [fate.wall for fate in fates_of(walls, truth, segments, [2, 2])] == [int(truth.walls[0])]
    assert vote((25, 30), FACES, truth.walls).wall == UNLABELLED


def lies_on(walls, truth, first, last):
    segments = segments_of([[first, last]], [[0, 9]])
    (fate,) = fates_of(walls, truth, segments, [-1])
    return fate.on


@pytest.mark.parametrize(
    ("first", "last", "on"),
    [
        ((1.0, 0.0), (3.0, 0.0), (2,)),
        # Overlaps by a fifth of a metre, or by less.
        ((-1.0, 0.0), (0.201, 0.0), (2,)),
        ((-1.0, 0.0), (0.199, 0.0), ()),
        ((4.799, 0.0), (6.0, 0.0), (2,)),
        ((4.801, 0.0), (6.0, 0.0), ()),
        # Half a metre beside it, measured from its middle, or more.
        ((1.0, 0.499), (3.0, 0.499), (2,)),
        ((1.0, 0.501), (3.0, 0.501), ()),
        ((1.0, -0.499), (3.0, -0.499), (2,)),
        ((1.0, -0.501), (3.0, -0.501), ()),
        ((1.0, 0.2), (3.0, 0.7), (2,)),
        # Seen from the other side, or turned by more than 45 degrees.
        ((3.0, 0.0), (1.0, 0.0), ()),
        ((1.0, -0.44), (1.9, 0.44), (2,)),
        ((1.0, -0.46), (1.9, 0.46), ()),
    ],
)
def test_a_segment_lies_on_what_it_overlaps_faces_and_is_near_to(walls, truth, first, last, on):
    assert lies_on(walls, truth, first, last) == on


def test_a_segment_lies_on_firm_walls_only(walls, truth):
    doubtful = replace(walls, tentative=IDS == 2)
    assert lies_on(doubtful, truth, (1.0, 0.0), (3.0, 0.0)) == ()
    assert lies_on(doubtful, truth, (5.0, 1.0), (5.0, 3.0)) == (3,)


def test_what_lay_on_a_wall_is_asked_of_the_map_before_the_scan(walls, truth, make_map):
    observer = Observer(truth.walls, lambda index: FACES)
    segments = segments_of([[[1.0, 0.0], [3.0, 0.0]]], [[0, 9]])
    observer(step(make_map(SQUARE[1:], POSE, ids=IDS[1:]), 1))
    observer(step(walls, 2, segments=segments, owners=[2]))
    observer(step(walls, 3, segments=segments, owners=[2]))
    assert [(fate.known, fate.on) for fate in observer.fates] == [(False, ()), (True, (2,))]


def test_matches_are_counted_against_the_wall_of_most_beams(truth):
    one = np.eye(len(truth.faces), dtype=np.int64)
    votes = Votes(truth, {2: 9 * one[0] + 5 * one[1], 3: 4 * one[1]})
    wall = [int(w) for w in truth.walls]
    fates = [
        Fate(2, True, wall[0], ()), Fate(2, True, wall[0], (3,)), Fate(3, True, wall[0], (2,)),
        Fate(99, True, wall[0], ()), Fate(5, False, wall[0], (3, 2)), Fate(-1, False, wall[1], (2, 3)),
        Fate(-1, False, wall[0], (3,)), Fate(-1, False, wall[1], ()), Fate(-1, False, wall[1], (99,)),
    ]  # fmt: skip
    assert association_counts(fates, votes) == {"matches_true": 2, "matches_false": 2, "matches_missed": 2}
    assert association_counts([], votes) == {"matches_true": 0, "matches_false": 0, "matches_missed": 0}


def test_true_and_false_matches_are_not_exchanged(truth):
    one = np.eye(len(truth.faces), dtype=np.int64)
    votes = Votes(truth, {2: one[0]})
    wall, other = int(truth.walls[0]), int(truth.walls[1])
    fates = [Fate(2, True, wall, ()), Fate(2, True, wall, ()), Fate(2, True, other, ())]
    assert association_counts(fates, votes) == {"matches_true": 2, "matches_false": 1, "matches_missed": 0}


def test_the_limits_of_lying_on_a_wall_count_as_on_it(make_map):
    walls = make_map(np.array([[[0.0, 0.0], [4.0, 0.0]]]), np.zeros(3))
    touching = np.array([[[-1.0, 0.0], [OVERLAP_M, 0.0]], [[1.0, NEAR_M], [3.0, NEAR_M]]])
    assert [rows.tolist() for rows in _lying_on(touching, np.zeros(3), walls)] == [[0], [0]]
