"""Which wall a line came from, beam by beam, against plain loops over beams."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.scoring.association import OVERLAP_M, Votes, duplicate_lines, duplicate_pairs
from chainslam.experiments.scoring.beam_votes import UNLABELLED, vote
from chainslam.experiments.scoring.truth import truth_of
from chainslam.sim.robot import RobotConfig
from chainslam.slam.extraction.segments import Segments

WALLS = np.array([0, 0, 1, 2, 2, 3])
"""Of six faces: two walls have two each."""
BEAMS = 40


@pytest.fixture
def truth(world):
    n = len(WALLS)
    made = truth_of(world, RobotConfig())
    return replace(made, faces=np.zeros((n, 2, 2)), lines=np.zeros((n, 2)), walls=WALLS, rings=np.zeros(n, int))


def segments_of(spans):
    n, none = len(spans), np.zeros((len(spans), 2))
    return Segments(none, np.zeros((n, 2, 2)), np.zeros((n, 2, 2)), np.array(spans), np.full(n, 5), none > 0,
                    np.zeros(n), np.zeros(n, bool))  # fmt: skip


def beams_of(first, last):
    """The beams from the first to the last, on over the seam."""
    found = [first]
    while found[-1] != last:
        found.append((found[-1] + 1) % BEAMS)
    return found


@pytest.mark.parametrize("seed", range(5))
def test_votes_and_labels_are_those_of_plain_loops(truth, seed):
    rng, votes = np.random.default_rng(seed), Votes(truth)
    counts, fused = {}, []
    for _ in range(12):
        face_of_beam = np.repeat(rng.integers(-1, 6, 10), 4)
        spans = [tuple(rng.integers(0, BEAMS, 2).tolist()) for _ in range(3)]
        owners = rng.integers(-1, 5, 3)
        votes.add(segments_of(spans), owners, face_of_beam)
        for span, owner in zip(spans, owners.tolist(), strict=True):
            if owner < 0:
                continue
            faces = [int(face_of_beam[beam]) for beam in beams_of(*span)]
            line = counts.setdefault(owner, [0] * 6)
            for face in faces:
                if face >= 0:
                    line[face] += 1
            walls = [sum(1 for f in faces if f >= 0 and WALLS[f] == wall) for wall in range(4)]
            fused.append((owner, walls.index(max(walls)) if max(walls) >= 0.8 * len(faces) else UNLABELLED))
    assert {line: beams.tolist() for line, beams in votes.beams.items()} == counts
    assert votes.fused == fused
    labels = {}
    for line, beams in counts.items():
        walls = [sum(b for b, wall in zip(beams, WALLS, strict=True) if wall == w) for w in range(4)]
        wall = walls.index(max(walls))
        labels[line] = wall if max(walls) else UNLABELLED
        mine = [b if w == wall else -1 for b, w in zip(beams, WALLS, strict=True)]
        assert votes.face_of(line) == (mine.index(max(mine)) if max(walls) else UNLABELLED)
    ids = np.array(sorted(counts))
    assert votes.walls_of(ids).tolist() == [labels[line] for line in ids]
    assert votes.faces_of(np.array([99, *ids])).tolist() == [
        UNLABELLED,
        *(votes.face_of(line) for line in sorted(counts)),
    ]
    assert votes.false_matches() == sum(wall not in (UNLABELLED, labels[line]) for line, wall in fused)


def test_segments_of_few_beams_that_moved_the_estimate_are_matches_and_say_nothing_of_a_line(truth):
    """A line is of wall 0 by its segments; of its few beams some came from there, some from wall 2."""
    votes = Votes(truth)
    face_of_beam = np.repeat([0, 3, 2, 0], 10)
    spans = [(0, 9), (10, 12), (20, 22), (30, 32), (18, 21)]
    votes.add(segments_of(spans), np.array([5, -1, -1, -1, -1]), face_of_beam,
              np.array([[0, 5], [1, 5], [3, 5], [2, 9], [4, 5]]))  # fmt: skip
    assert votes.fused == [(5, 0)]
    assert votes.fused_of_few_beams == [(5, 2), (5, 0), (9, 1), (5, UNLABELLED)]
    assert votes.beams.keys() == {5}
    assert votes.false_matches_few_beams() == votes.false_matches() == 1  # line 9 has no beams of its own yet
    votes.add(segments_of([(20, 29)]), np.array([5]), face_of_beam)
    assert (votes.false_matches_few_beams(), votes.false_matches()) == (1, 2)
    votes.merge(5, 9)
    assert votes.false_matches_few_beams() == 2  # and now line 9 is known to be line 5


@pytest.mark.parametrize(("other", "label"), [(2, 1), (3, UNLABELLED)])
@pytest.mark.parametrize("missing", [-1, 3])
def test_a_segment_is_of_one_wall_by_four_fifths_of_all_its_beams(truth, other, label, missing):
    """Of ten beams; those that hit nothing count against it, too."""
    face_of_beam, votes = np.full(BEAMS, missing), Votes(truth)
    face_of_beam[: 10 - other] = 2
    votes.add(segments_of([(0, 9)]), np.array([4]), face_of_beam)
    assert votes.fused == [(4, label)]


def test_a_segment_that_hit_nothing_is_of_no_wall(truth):
    votes = Votes(truth)
    votes.add(segments_of([(0, 9)]), np.array([4]), np.full(BEAMS, -1))
    assert votes.fused == [(4, UNLABELLED)]
    assert (votes.face_of(4), votes.false_matches()) == (UNLABELLED, 0)


def test_a_wall_of_two_faces_is_one_and_its_longer_face_stands_for_it(truth):
    votes = Votes(truth, {1: np.array([30, 31, 60, 0, 0, 0]), 2: np.array([0, 0, 62, 30, 31, 0])})
    assert (votes.face_of(1), votes.face_of(2)) == (1, 2)
    assert votes.walls_of(np.array([1, 2])).tolist() == [0, 1]


@pytest.mark.parametrize(("others", "false"), [(2, 0), (3, 0), (4, 1)])
def test_a_false_merger_joins_two_lines_that_are_each_of_one_wall(truth, others, false):
    """A line across both walls, two of its three beams on the other, says little about which of them it is."""
    for keep, drop in ((1, 2), (2, 1)):
        votes = Votes(truth, {1: np.array([400, 0, 3, 0, 0, 0]), 2: np.array([1, 0, others, 0, 0, 0])})
        votes.merge(keep, drop)
        assert (votes.merges, votes.false_merges) == (1, false)


def test_merging_adds_beams_once_and_follows_lines_that_were_merged_before(truth):
    votes = Votes(truth, {k: 10 * np.eye(6, dtype=np.int64)[face] for k, face in enumerate((0, 1, 2, 5))})
    votes.merge(1, 0)
    assert (votes.merges, votes.false_merges) == (1, 0), "two faces of one wall"
    votes.merge(2, 1)
    assert (votes.merges, votes.false_merges) == (2, 1)
    expected = [10, 10, 10, 0, 0, 0]
    assert [votes.beams[line].tolist() for line in (0, 1, 2)] == [expected, expected, expected]
    assert votes.beams[3].tolist() == [0, 0, 0, 0, 0, 10]
    votes.add(segments_of([(0, 3)]), np.array([0]), np.full(BEAMS, 3))
    assert votes.beams[2].tolist() == [10, 10, 10, 4, 0, 0]
    # One that no beam tells of.
    votes.merge(3, 7)
    assert (votes.merges, votes.false_merges, votes.beams[7].tolist()) == (3, 1, [0, 0, 0, 0, 0, 10])
    votes.merge(8, 9)
    assert votes.beams[8].tolist() == votes.beams[9].tolist() == [0] * 6
    assert votes.false_merges == 1


def along(*spans):
    """Walls on the x axis from here to there."""
    return np.array([[[a, 0.0], [b, 0.0]] for a, b in spans])


@pytest.mark.parametrize(("overlap_m", "count"), [(OVERLAP_M, 1), (OVERLAP_M - 1e-6, 0)])
@pytest.mark.parametrize("turned", [False, True])
def test_lines_of_one_wall_that_overlap_over_twenty_centimetres_are_one_too_many(make_map, overlap_m, count, turned):
    assert OVERLAP_M == 0.2
    faces = along((0.0, 1.0), (1.0 - overlap_m, 2.0))
    walls = make_map(faces[..., ::-1] if turned else faces, np.zeros(3))
    every, labels = np.ones(2, bool), np.zeros(2, np.int64)
    assert duplicate_lines(walls, labels, every) == count
    assert duplicate_lines(walls, labels, np.array([True, False])) == 0
    assert duplicate_lines(walls, np.array([0, 1]), every) == 0
    assert duplicate_lines(walls, np.array([-1, -1]), every) == 0


def test_each_line_too_many_is_told_with_the_first_that_it_overlaps(make_map):
    faces = along((0.0, 1.0), (3.0, 4.0), (0.5, 3.5), (0.2, 0.6), (3.6, 9.0), (0.0, 9.0))
    walls = make_map(faces, np.zeros(3), ids=np.array([2, 3, 5, 7, 11, 13]))
    pairs = duplicate_pairs(walls, np.array([4, 4, 4, 4, 4, 6]), np.ones(6, bool))
    assert pairs == [(2, 5), (2, 7), (3, 11)]
    among = np.array([False, True, True, True, True, True])
    # The fourth overlaps the third by a tenth of a metre only.
    assert duplicate_pairs(walls, np.array([4, 4, 4, 4, 4, 6]), among) == [(3, 5), (3, 11)]
    labels = np.array([9, 4, 4, 9, 4, 9])
    assert sorted(duplicate_pairs(walls, labels, np.ones(6, bool))) == [(2, 7), (2, 13), (3, 5), (3, 11)]
    assert duplicate_pairs(walls, labels, np.zeros(6, bool)) == []


def test_a_wall_that_is_not_along_an_axis_is_measured_along_itself(make_map):
    turn = np.array([[np.cos(0.7), np.sin(0.7)], [-np.sin(0.7), np.cos(0.7)]])
    walls = make_map(along((0.0, 1.0), (0.79, 2.0)) @ turn + 5.0, np.zeros(3))
    assert duplicate_lines(walls, np.zeros(2, np.int64), np.ones(2, bool)) == 1
    apart = replace(walls, extents=walls.extents * 0.9)
    assert duplicate_lines(apart, np.zeros(2, np.int64), np.ones(2, bool)) == 0


def test_counts_are_whole_numbers_and_no_lines_have_no_faces(truth):
    votes, face_of_beam = Votes(truth), np.repeat(np.arange(6), 4)
    votes.add(segments_of([(0, 3), (8, 11)]), np.array([7, 9]), face_of_beam)
    votes.merge(9, 11)
    votes.merge(12, 13)
    assert {beams.dtype for beams in votes.beams.values()} == {np.dtype(np.int64)}
    none = votes.faces_of(np.zeros(0, dtype=np.int64))
    assert none.dtype == np.int64
    assert votes.walls_of(np.zeros(0, dtype=np.int64)).tolist() == []
    assert Votes(truth).false_matches() == 0


def test_a_line_of_one_beam_is_of_the_face_of_that_beam(truth):
    votes = Votes(truth)
    for face in range(6):
        votes.beams[face] = np.eye(6, dtype=np.int64)[face]
    assert votes.faces_of(np.arange(6)).tolist() == list(range(6))


def test_an_overlap_of_just_twenty_centimetres_is_one_too_many(make_map):
    walls = make_map(np.array([[[0.0, 0.0], [OVERLAP_M, 0.0]], [[0.0, 0.0], [2.0, 0.0]]]), np.zeros(3))
    assert duplicate_lines(walls, np.zeros(2, dtype=np.int64), np.ones(2, dtype=bool)) == 1


def test_a_vote_tells_beams_winner_and_the_face_of_most_of_its_beams():
    face_of_beam = np.array([3, 4, 4, 4, 1, -1, 5, 5, -1, -1])
    told = vote((0, 5), face_of_beam, WALLS)
    assert told.faces.tolist() == [3, 4, 4, 4, 1]
    assert (told.beams, told.winner, told.on_winner, told.face) == (6, 2, 4, 4)
    assert (told.is_clear, told.wall) == (False, UNLABELLED)
    around = vote((8, 3), face_of_beam, WALLS)
    assert (around.beams, around.winner, around.on_winner, around.face) == (6, 2, 4, 4)
    nothing = vote((8, 9), face_of_beam, WALLS)
    assert nothing.faces.tolist() == []
    assert (nothing.beams, nothing.winner, nothing.on_winner, nothing.face) == (2, UNLABELLED, 0, UNLABELLED)
