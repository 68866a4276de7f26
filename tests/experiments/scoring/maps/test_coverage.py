"""What of the reachable contour is mapped, and which contours are closed, in a square room of 5 m with a pillar."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from scipy.optimize import minimize

from chainslam.experiments.scoring.association import Votes
from chainslam.experiments.scoring.maps.coverage import (
    CLOSED_SHARE,
    NEAR_M,
    NEAR_NOISY_M,
    PITCH_M,
    alignment,
    began,
    closed_contours,
    coverage,
    coverage_curve,
    covered,
    own_alignment,
    sample,
)
from chainslam.experiments.scoring.records import Sketch
from chainslam.experiments.scoring.truth import truth_of
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import World
from chainslam.slam.geometry.poses import compose, inverse, to_world
from chainslam.slam.map.chains import Chain, OpenEnd

OUTER, PILLAR = [0, 1, 2, 3], [4, 5, 6, 7]
STILL = np.zeros(3)


@pytest.fixture
def truth(world):
    return truth_of(world, RobotConfig())


@pytest.fixture
def samples(truth):
    return sample(truth)


def test_these_are_the_lengths_that_the_scores_are_defined_by():
    assert (NEAR_M, NEAR_NOISY_M, CLOSED_SHARE) == (0.1, 0.3, 0.9)


def test_the_contour_is_cut_into_equal_pieces_of_two_centimetres_at_most(truth, samples):
    assert samples.length_m.max() <= PITCH_M + 1e-12
    for face, (start, end) in enumerate(truth.faces):
        length, ring = np.hypot(*(end - start)), truth.rings[face]
        along = (end - start) / length
        mine = np.abs((samples.points_world - start) @ [-along[1], along[0]]) < 1e-9
        mine &= (samples.rings == ring) & (np.abs(samples.normals_world @ along) < 1e-9)
        at = np.sort((samples.points_world[mine] - start) @ along)
        at = at[(at > 0) & (at < length)]
        count = int(np.ceil(length / PITCH_M))
        np.testing.assert_allclose(at, (np.arange(count) + 0.5) * length / count, atol=1e-9)
        # The normals point into the wall, which lies on the right of its face.
        np.testing.assert_allclose(samples.normals_world[mine], np.tile([along[1], -along[0]], (count, 1)), atol=1e-9)
    assert samples.length_m.sum() == pytest.approx(20.0 + 2.4)
    assert samples.rings.tolist() == sorted(samples.rings.tolist())


def test_a_contour_of_which_a_part_is_seen_counts_by_that_part():
    """A room of 2 m and a corridor of 20 m by 3 m: from its near end, which is all that is free, 4 m can be seen."""
    free = shapely.Polygon([(0, 0), (20, 0), (20, 0.3), (2, 0.3), (2, 2), (0, 2)])
    truth = truth_of(World("corridor", free, np.array([1.0, 1.0, 0.0]), {}), RobotConfig())
    found = sample(truth)
    assert found.length_m.sum() == pytest.approx(truth.contour.length_m)
    assert found.length_m.sum() < free.length - 20.0
    assert shapely.LineString([(0, 0), (20, 0)]).distance(shapely.points(found.points_world[0])) < 1e-9


@pytest.mark.parametrize(("off_m", "share"), [(0.099, 1.0), (0.101, 0.0)])
@pytest.mark.parametrize("side", [-1.0, 1.0])
def test_a_point_is_covered_by_a_wall_that_is_near_on_either_side(samples, off_m, share, side):
    wall = np.array([[[0.0, side * off_m], [5.0, side * off_m]]])
    mine = (samples.points_world[:, 1] < 1e-9) & (samples.normals_world[:, 1] < -0.5)
    assert np.mean(covered(samples, wall, 0.1)[mine]) == pytest.approx(share, abs=0.02)
    assert not covered(samples, wall, 0.1)[~mine].any()


@pytest.mark.parametrize(("turn_deg", "counts"), [(44.0, True), (46.0, False), (-44.0, True), (-46.0, False)])
def test_a_wall_covers_only_what_faces_within_45_degrees_of_it(samples, turn_deg, counts):
    """A short wall in the middle of the lower side, turned."""
    turn, half = np.deg2rad(turn_deg), 0.04
    ends = np.array([2.5, 0.0]) + half * np.array([[-np.cos(turn), -np.sin(turn)], [np.cos(turn), np.sin(turn)]])
    assert covered(samples, ends[None], 0.1).any() == counts


def test_the_covered_share_is_by_length(samples, truth):
    assert coverage(samples, truth.faces[OUTER], 0.01) == pytest.approx(20.0 / 22.4)
    assert coverage(samples, truth.faces[PILLAR[:1]], 0.01) == pytest.approx(0.6 / 22.4)
    assert coverage(samples, np.zeros((0, 2, 2)), 0.1) == 0.0


def chain_of(walls, ends=()):
    return Chain(tuple(walls), np.zeros((len(walls), 2)), tuple(ends))


def votes_of(truth, beams=100):
    return Votes(truth, {k: beams * np.eye(len(truth.faces), dtype=np.int64)[k] for k in range(len(truth.faces))})


@pytest.fixture
def closed(samples, truth, make_map):
    """Which contours a chain of these walls, cut to shares of their faces, stands for."""

    def contours(shares, chains=None, votes=None, moved=STILL, to_true=STILL, near=NEAR_M):
        pieces = np.array([[a, a + share * (b - a)] for (a, b), share in zip(truth.faces, shares, strict=True)])
        walls = make_map(to_world(pieces, moved), np.zeros(3))
        chains = (chain_of(OUTER), chain_of(PILLAR)) if chains is None else chains
        return closed_contours(samples, walls, chains, votes or votes_of(truth), to_true, near)

    return contours


def test_a_chain_that_was_closed_across_a_door_closes_no_contour(closed):
    """A chain of nine tenths of its contour closes it, one of less was closed by mistake."""
    assert closed(8 * [1.0]) == [0, 1]
    assert closed([1.0, 1.0, 1.0, 0.62] + 4 * [1.0]) == [0, 1]
    assert closed([1.0, 1.0, 1.0, 0.55] + 4 * [1.0]) == [1]
    assert closed(7 * [1.0] + [0.0001]) == [0]
    assert closed([0.91] * 4 + [0.87] * 4, near=0.001) == [0]


def test_an_open_chain_and_one_that_no_beam_tells_of_close_none(closed, truth):
    ends = (OpenEnd(0, 0, np.zeros(2)), OpenEnd(3, 1, np.zeros(2)))
    assert closed(8 * [1.0], (chain_of(OUTER, ends), chain_of(PILLAR))) == [1]
    votes = votes_of(truth)
    for wall in OUTER:
        del votes.beams[wall]
    assert closed(8 * [1.0], votes=votes) == [1]
    assert closed(8 * [1.0], ()) == []


def test_a_chain_belongs_to_the_contour_of_most_of_its_beams(closed, truth):
    """Walls that lie along the outer contour, but were seen on the pillar, close neither."""
    votes = votes_of(truth)
    votes.beams[0] = np.array([10, 0, 0, 0, 0, 309, 0, 0])
    assert closed(8 * [1.0], (chain_of(OUTER),), votes) == [0], "309 beams of 619 do not outweigh the others"
    votes.beams[0] = np.array([10, 0, 0, 0, 0, 311, 0, 0])
    assert closed(8 * [1.0], (chain_of(OUTER),), votes) == []
    # A wall of the chain without any vote does not hinder it.
    votes = votes_of(truth)
    del votes.beams[2]
    assert closed(8 * [1.0], votes=votes) == [0, 1]


def test_two_chains_around_one_contour_close_it_once(closed):
    assert closed(8 * [1.0], (chain_of(PILLAR), chain_of(OUTER), chain_of(PILLAR))) == [0, 1]


def test_a_map_is_moved_to_the_truth_before_it_is_held_against_it(closed):
    moved = np.array([0.4, -0.3, 0.2])
    assert closed(8 * [1.0], moved=moved) == []
    assert closed(8 * [1.0], moved=moved, to_true=inverse(moved)) == [0, 1]
    off = np.array([0.0, 0.2, 0.0])
    assert closed(8 * [1.0], moved=off) == []
    assert closed(8 * [1.0], moved=off, near=NEAR_NOISY_M) == [0, 1]


def test_a_contour_of_which_nothing_worth_speaking_of_can_be_seen_is_not_closed(truth, samples, make_map):
    outer = replace(truth, contour=replace(truth.contour, rings=np.array([0])))
    walls = make_map(truth.faces, np.zeros(3))
    assert closed_contours(samples, walls, (chain_of(OUTER), chain_of(PILLAR)), votes_of(outer), STILL, NEAR_M) == [0]


def test_the_frames_of_the_first_poses_are_laid_on_each_other():
    estimated, true = np.array([0.3, -0.2, 0.5]), np.array([1.0, 2.0, -0.4])
    motion = alignment(estimated, true)
    np.testing.assert_allclose(compose(motion, estimated), true, atol=1e-12)


def test_a_map_that_began_in_the_blind_is_laid_on_the_truth_by_all_that_followed():
    """Least squares over places and a metre ahead of each, from the step on at which it began; by a search."""
    rng = np.random.default_rng(2)
    true = np.column_stack([rng.uniform(0, 5, (6, 2)), rng.uniform(-3, 3, 6)])
    lost = np.array([0.4, -0.7, 0.3])
    estimated = np.array([compose(lost, pose) for pose in true]) + 0.05 * rng.normal(size=(6, 3))

    def off(motion):
        total = 0.0
        for a, b in zip(estimated[2:], true[2:], strict=True):
            for ahead in (0.0, 1.0):
                p, q = (c[:2] + ahead * np.array([np.cos(c[2]), np.sin(c[2])]) for c in (a, b))
                total += np.sum((to_world(p[None], motion)[0] - q) ** 2)
        return total

    best = minimize(off, np.zeros(3), tol=1e-12).x
    np.testing.assert_allclose(own_alignment(estimated[0], estimated, true, 2), best, atol=1e-5)
    first = own_alignment(true[0] + lost, estimated, true, 0)
    np.testing.assert_allclose(first, alignment(true[0] + lost, true[0]))


@pytest.mark.parametrize(
    ("lines", "step"),
    [([1, 2, 3], 0), ([0, 0, 4, 5], 2), ([0, 3, 0, 5, 6], 3), ([0, 0, 0], 2), ([1], 0), ([0], 0), ([0, 1, 1, 1], 1)],
)
def test_a_map_began_after_the_last_step_without_a_line(lines, step):
    assert began(np.array(lines)) == step


def test_the_curve_tells_what_each_sketch_of_the_map_covers(truth, samples):
    moved = np.array([3.0, -2.0, 0.7])
    ends = to_world(truth.faces, inverse(moved))
    sketches = [Sketch(0.5, ends[:1]), Sketch(2.5, ends[:3]), Sketch(7.0, ends)]
    curve = coverage_curve(samples, sketches, moved, 0.05)
    assert list(curve) == ["path_length_m", "coverage"]
    assert curve["path_length_m"] == [0.5, 2.5, 7.0]
    expected = [coverage(samples, truth.faces[:count], 0.05) for count in (1, 3, len(truth.faces))]
    assert curve["coverage"] == pytest.approx(expected)
    assert 0.0 < expected[0] < expected[1] < expected[2] == pytest.approx(1.0)
    aside = [Sketch(1.0, ends + 0.08)]
    near, far = (coverage_curve(samples, aside, moved, within_m)["coverage"][0] for within_m in (0.05, 0.3))
    assert near < far
