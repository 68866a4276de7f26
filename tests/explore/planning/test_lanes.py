"""Lanes: floor beside a wall on which the body fits, cut where something stands against it."""

import numpy as np
import pytest
from scipy.ndimage import label

from chainslam.explore.planning.lanes import lanes_of
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.planning.paths import Planner
from chainslam.slam.geometry.lines import normals

pytestmark = pytest.mark.usefixtures("_unchecked")

STANDOFF_M = 0.35
CELL_M = 0.05


@pytest.mark.parametrize("seed", [0, 1, 2])
def test_lanes_are_pieces_of_floor_beside_a_wall_and_round_its_ends(scene_of, seed):
    scene = scene_of(seed)
    planner = Planner(scene.grid, scene.places[0], PathConfig())
    walls = scene.walls(np.append(scene.places[0], 0.0))
    found = []
    for wall, (tail, head) in enumerate(walls.ends_world):
        lanes = lanes_of(wall, walls, planner, STANDOFF_M)
        found.append(len(lanes))
        for lane in lanes:
            places = planner.centres(np.zeros(2, dtype=int), planner.nowhere.shape)[tuple(lane.cells.T)]
            assert planner.passable_lines(places, places).all()
            drawn = planner.nowhere
            drawn[tuple(lane.cells.T)] = True
            assert label(drawn, structure=np.ones((3, 3)))[1] == 1
            length_m = np.hypot(*(head - tail))
            along = np.clip((places - tail) @ (head - tail) / length_m, 0.0, length_m)
            gap = places - tail - along[:, None] * (head - tail) / length_m
            assert np.hypot(*gap.T).max() < 2.0 * STANDOFF_M + CELL_M
            # Straight beside the wall, and not past its ends, everything is on its free side.
            beside = (along > 0.0) & (along < length_m)
            assert np.all(gap[beside] @ normals(walls.belief.means[wall, :1])[0] < 0.0)
            nearest = np.hypot(*(lane.stops_world[:, None] - places).transpose(2, 0, 1)).min(axis=1)
            assert nearest.max() < CELL_M
    assert max(found) > 1
