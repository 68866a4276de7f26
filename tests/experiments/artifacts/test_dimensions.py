"""Lengths and areas of a map whose closed chains are no rooms."""

import numpy as np

from chainslam.experiments.artifacts.maps.dimensions import dimensions
from chainslam.experiments.artifacts.maps.mapped import MappedCorners, Room
from chainslam.experiments.scoring.maps.measurements import CornerPoints


def test_a_closed_chain_of_two_walls_has_sides_and_no_area():
    positions = np.array([[0.0, 0.0], [2.0, 0.0]])
    points = CornerPoints(positions, 1e-4 * np.eye(4).reshape(2, 2, 2, 2))
    for is_island in (True, False):
        mapped = MappedCorners(points, ((0, 1), (1, 0)), (0, 0), (True, True), (Room(0, (0, 1), is_island),))
        found = dimensions(mapped)
        assert len(found) == 2
        assert not any(each.is_area for each in found)
