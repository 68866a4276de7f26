"""Two real floor plans, as they come with the tests; all the others are for `make plans`."""

from pathlib import Path

import numpy as np
import pytest
import shapely

from chainslam.sim.worlds import load

PLANS = Path(__file__).parents[2] / "data" / "plans"
FLOORS = {"apartment": (25.6, 19.3, 2), "school": (332.9, 302.9, 3)}
"""Free floor and what the centre of a disc of 0.2 m reaches, m2, by those who made the files; contours."""


@pytest.mark.parametrize("name", FLOORS)
def test_a_real_plan_loads_with_a_valid_free_space_and_a_clear_start(name):
    world = load(PLANS / f"{name}.json")
    free_m2, reach_m2, contours = FLOORS[name]
    at = shapely.Point(world.start[:2])
    assert world.free.is_valid
    assert world.free.contains(at)
    assert world.free.boundary.distance(at) >= 0.2
    # Our walls are 0.1 m thick, theirs are lines.
    assert world.free.area == pytest.approx(free_m2, rel=0.05)
    assert world.reachable().area == pytest.approx(reach_m2, rel=0.08)
    assert len(set(world.face_rings.tolist())) == contours


@pytest.mark.parametrize("name", FLOORS)
def test_a_real_building_is_almost_wholly_seen(name):
    world = load(PLANS / f"{name}.json")
    total = np.sum(np.hypot(*(world.faces[:, 1] - world.faces[:, 0]).T))
    assert 0.9 * total < world.reachable_contour().length_m <= total + 1e-6
    assert world.reachable_contour().contours == FLOORS[name][2]
