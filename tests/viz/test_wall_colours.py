"""Colours of walls in a timeline."""

import numpy as np
import pytest

from chainslam.slam.estimation.backend import Belief
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.viz import palette
from chainslam.viz.timeline.colours import WallColours, packed

IDS = np.array([3, 5, 8])


def walls(crooked):
    belief = Belief(np.zeros(3), np.eye(3), IDS, np.zeros((3, 2)), np.zeros((3, 2)), lambda _: pytest.fail("not asked"))
    return StochasticMap(belief, np.zeros((3, 2)), np.ones(3, dtype=np.int64), np.zeros(3, dtype=bool), crooked)


def test_a_crooked_wall_is_red_for_as_long_as_it_is_crooked_and_no_other_changes():
    colours, chains = WallColours(), (Chain((3, 5), np.zeros((1, 2)), ()),)
    straight = colours.of_walls(walls(np.zeros(3, dtype=bool)), chains)
    assert straight.tolist() == [packed(palette.CLOSED[0])] * 2 + [packed(palette.TENTATIVE)]
    bent = colours.of_walls(walls(np.array([False, True, False])), chains)
    assert bent.tolist() == [straight[0], packed(palette.CROOKED), straight[2]]
    assert colours.of_walls(walls(np.zeros(3, dtype=bool)), chains).tolist() == straight.tolist()
