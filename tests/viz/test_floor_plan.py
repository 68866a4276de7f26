"""The words of a floor plan: where they stand, also where there is no room for any."""

import numpy as np

from chainslam.viz.floor_plan import Dimension


def test_the_area_of_a_room_without_floor_stands_in_it_and_is_not_shown():
    area = Dimension(np.array([2.0, 1.0]), np.zeros(2), "0.0 m²", "an empty room", is_area=True)
    np.testing.assert_array_equal(area.beside_world, [2.0, 1.0])
    assert area.shown == ""
