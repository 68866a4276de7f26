"""Scenes of the default matcher, assigned jointly: walls seen whole, walls beyond their end, slips, vague segments."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.slam.association.matchers.joint_assignment import assign
from chainslam.slam.association.matching import KnownWalls, MatchingConfig
from chainslam.slam.estimation.backend import Joint
from tests.slam.association.test_matching import PIECES, straight_pieces, three_walls

CONFIG = MatchingConfig(method="assignment")


def test_clear_scenes_are_matched():
    walls, joint = three_walls(0.0)
    found = assign(straight_pieces(PIECES), walls, joint, CONFIG, clear_only=True)
    assert found.pairs.tolist() == [[0, 0], [1, 1], [2, 2]]
    assert not len(found.doubtful)


def test_a_segment_beyond_a_walls_end_is_none_of_it():
    walls, joint = three_walls(0.0)
    found = assign(straight_pieces([*PIECES, [[3.0, 0.5], [3.0, 1.6]]]), walls, joint, CONFIG)
    assert found.pairs.tolist() == [[0, 0], [1, 1], [2, 2]]
    assert found.unmatched.tolist() == [3]


def test_vague_segments_alone_match_nothing():
    walls, joint = three_walls(0.0)
    segments = straight_pieces(PIECES)
    vague = replace(segments, is_tentative=np.ones(3, dtype=bool))
    assert not len(assign(vague, walls, joint, CONFIG).pairs)
    some = replace(segments, is_tentative=np.array([False, True, True]))
    assert assign(some, walls, joint, CONFIG).pairs.tolist() == [[0, 0], [1, 1], [2, 2]]


@pytest.mark.parametrize("slip_rad", [-0.05, 0.0, 0.05])
def test_after_a_slip_the_next_rooms_wall_is_not_clear(slip_rad):
    walls, joint = three_walls(slip_rad)
    segments = straight_pieces([*PIECES, [[3.0, 0.05], [3.0, 1.2]]])
    clear = assign(segments, walls, joint, CONFIG, clear_only=True)
    assert clear.pairs.tolist() == [[0, 0], [1, 1], [2, 2]]


@pytest.mark.parametrize("turn_rad", [0.0195, 0.03])
def test_a_pair_that_the_others_contradict_is_given_up(turn_rad):
    walls, joint = three_walls(0.0)
    c, s = np.cos(turn_rad), np.sin(turn_rad)
    middle = np.mean(PIECES[0], axis=0)
    bent = (np.array(PIECES[0]) - middle) @ np.array([[c, s], [-s, c]]) + middle
    found = assign(straight_pieces([bent, *PIECES[1:]]), walls, joint, CONFIG)
    assert found.pairs.tolist() == [[1, 1], [2, 2]]


@pytest.mark.parametrize(("whole", "one"), [(True, False), (False, True)])
def test_a_segment_that_shows_more_than_a_short_wall_seen_whole_is_none_of_it(whole, one):
    joint = Joint(np.zeros(5), np.diag([1e-3, 1e-3, 1e-3, 0.02, 0.005]) ** 2, np.array([[1.0, 0.0]]))
    wall = KnownWalls(np.array([5]), np.array([[-0.05, 0.05]]), np.array([whole]))
    found = assign(straight_pieces([[[1.0, -0.05], [1.0, 0.55]]]), wall, joint, CONFIG)
    assert found.pairs.tolist() == ([[0, 5]] if one else [])
