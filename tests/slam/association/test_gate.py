"""The gate itself, against numbers worked out by hand: two degrees of freedom, and what pose and line share."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.stats import chi2

from chainslam.slam.association.kernels.hypothesis_kernels import agree
from chainslam.slam.association.kernels.rest_kernels import compatible
from chainslam.slam.association.matching import KnownWalls, match
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.estimation.gates import gate_level, pair_levels
from chainslam.slam.extraction.segments import Segments

SURE = np.zeros(1, bool)
"""Of a segment of many beams."""
LEVEL = -2.0 * np.log(0.01)
"""What chi-square with two degrees of freedom exceeds once in a hundred times: 9.21; with three it would be 11.34."""
WALL = KnownWalls(np.array([5]), np.array([[-2.0, 2.0]]))


def seen(turn_rad=0.0, nearer_m=0.0, sigma_rad=0.01, sigma_m=0.01):
    """Return one segment of 1 m straight ahead, where a wall at 2 m would be seen, turned and nearer by so much."""
    line = np.array([[turn_rad, 2.0 - nearer_m]])
    n, t = np.array([np.cos(turn_rad), np.sin(turn_rad)]), np.array([-np.sin(turn_rad), np.cos(turn_rad)])
    ends = (2.0 - nearer_m) * n + np.array([[-0.5], [0.5]]) * t
    cov = np.diag([sigma_rad, sigma_m])[None] ** 2
    return Segments(
        line, cov, ends[None], np.array([[0, 9]]), np.array([10]), np.zeros((1, 2), bool), np.zeros(1), SURE
    )


def known(pose_sigmas, line_sigmas, shared=0.0):
    """Return a pose at the origin and a wall 2 m ahead; `shared` is the correlation of x with the wall's offset."""
    sigmas = np.array([*pose_sigmas, *line_sigmas])
    correlation = np.eye(5)
    correlation[0, 4] = correlation[4, 0] = shared
    return Joint(np.zeros(5), correlation * np.outer(sigmas, sigmas), np.array([[2.0, 0.0]]))


@pytest.mark.parametrize(("share", "is_matched"), [(0.98, True), (1.02, False), (1.2, False)])
def test_a_segment_beyond_the_level_of_two_degrees_of_freedom_is_refused(share, is_matched):
    joint = known([1e-5, 1e-5, 1e-6], [1e-6, 1e-5])
    for segment in (seen(turn_rad=0.01 * np.sqrt(share * LEVEL)), seen(nearer_m=0.01 * np.sqrt(share * LEVEL))):
        assert len(match(segment, WALL, joint).pairs) == is_matched


@pytest.mark.parametrize(("share", "kept"), [(0.98, 2), (1.02, 1), (1.2, 1)])
def test_of_two_observations_the_one_beyond_that_level_is_dropped(share, kept):
    e = np.array([0.0, 0.0, np.sqrt(share * LEVEL), 0.0])
    two, level = np.array([0, 1]), gate_level(0.99, 2)
    assert len(compatible(two, e, np.eye(4), level, pair_levels(0.999999, 2))) == kept
    begins = np.array([True, False])
    pairs, _ = agree(two, two, e, np.eye(4), begins, level, gate_level(0.999999, 2), 0.1)
    assert len(pairs) == kept


def test_what_pose_and_wall_share_makes_no_gate_wider():
    """The robot does not know where the two of them stand to 0.3 m; how far apart they are it knows to a millimetre."""
    joint = known([0.3, 1e-4, 1e-4], [1e-4, 0.3], shared=1.0 - 1e-5)
    assert len(match(seen(), WALL, joint).pairs) == 1
    assert not len(match(seen(nearer_m=0.1), WALL, joint).pairs)
    apart = known([0.3, 1e-4, 1e-4], [1e-4, 0.3])
    assert len(match(seen(nearer_m=0.1), WALL, apart).pairs) == 1


def short(turn_rad, across_m, along_m, length_m):
    """Return a short segment beside the wall 2 m ahead, turned far beyond what its sigma of 0.02 rad allows."""
    n, t = np.array([np.cos(turn_rad), np.sin(turn_rad)]), np.array([-np.sin(turn_rad), np.cos(turn_rad)])
    centre = np.array([2.0 - across_m, along_m])
    ends = centre + np.array([[-0.5], [0.5]]) * length_m * t
    cov = np.array([[1.0, t @ centre], [t @ centre, (t @ centre) ** 2]]) * 0.02**2 + np.diag([0.0, 0.005**2])
    line = np.array([[turn_rad, n @ centre]])
    return Segments(
        line, cov[None], ends[None], np.array([[0, 5]]), np.array([6]), np.zeros((1, 2), bool), np.zeros(1), SURE
    )


@pytest.mark.parametrize(
    ("segment", "is_doubtful"),
    [
        (short(0.3, 0.02, 0.5, 0.2), True),
        (short(-0.3, 0.02, 0.5, 0.2), True),
        (short(0.3, 0.02, 0.5, 0.4), False),
        (short(0.3, 0.12, 0.5, 0.2), False),
        (short(0.6, 0.02, 0.5, 0.2), False),
        (short(0.3, 0.02, 2.05, 0.2), False),
    ],
    ids=["along it", "turned the other way", "long", "before it", "turned too far", "past its end"],
)
def test_a_short_segment_that_lies_on_a_wall_is_no_new_one_however_it_is_turned(segment, is_doubtful):
    """A beam of the next face turns three or four others by any angle: not the wall's line, and yet no other wall."""
    matches = match(segment, WALL, known([1e-5, 1e-5, 1e-6], [1e-6, 1e-5]))
    assert matches.unmatched.tolist() == [0]
    assert matches.doubtful.tolist() == [0] * is_doubtful


@pytest.mark.parametrize(("overlap_m", "is_matched"), [(0.01, False), (0.03, True)])
def test_a_segment_and_its_wall_overlap_by_more_than_a_touch(overlap_m, is_matched):
    """Two rooms' walls on one line stand no farther apart than the wall between is thick."""
    cov = np.array([[1.0, 2.0], [2.0, 4.0]]) * 0.01**2 + np.diag([0.0, 0.01**2])
    ends = np.array([[[2.0, 2.0 - overlap_m], [2.0, 3.0]]])
    segment = Segments(
        np.array([[0.0, 2.0]]),
        cov[None],
        ends,
        np.array([[0, 9]]),
        np.array([10]),
        np.zeros((1, 2), bool),
        np.zeros(1),
        SURE,
    )
    for clear_only in (True, False):
        found = match(segment, WALL, known([1e-5, 1e-5, 1e-6], [1e-6, 1e-5]), clear_only=clear_only)
        assert len(found.pairs) == is_matched


@pytest.mark.parametrize(("turn_rad", "is_matched"), [(0.9, True), (-0.9, True), (1.2, False), (-1.2, False)])
def test_a_line_that_faces_another_way_is_no_candidate_however_vague_its_direction(turn_rad, is_matched):
    assert len(match(seen(turn_rad, sigma_rad=0.6), WALL, known([0.5, 0.5, 0.1], [0.1, 0.1])).pairs) == is_matched


@pytest.mark.parametrize("beams", [4, 5])
def test_few_beams_alone_do_not_say_where_the_robot_is_but_belong_to_their_wall(beams):
    segment, joint = replace(seen(), is_tentative=np.array([beams < 5])), known([0.01, 0.01, 0.01], [0.01, 0.01])
    assert len(match(segment, WALL, joint, clear_only=True).pairs) == (beams >= 5)
    assert len(match(segment, WALL, joint).pairs) == 1


@pytest.mark.parametrize("squared", [7.0, 8.0, 9.0])
def test_observations_of_which_each_passes_are_dropped_until_all_together_do(squared):
    count = 16
    e = np.tile([np.sqrt(squared), 0.0], count)
    within = [k for k in range(2, count + 1) if k * squared <= chi2.ppf(0.999999, 2 * k)]
    levels = gate_level(0.99, 2), pair_levels(0.999999, count)
    kept = compatible(np.arange(count), e, np.eye(2 * count), *levels)
    assert len(kept) == max(within)
