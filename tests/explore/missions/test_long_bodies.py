"""A long body explores what lies behind a door that it fits through and the disc around it does not."""

import numpy as np
import pytest
import shapely

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import World

ROOMS = shapely.orient_polygons(
    shapely.box(0, 0, 6.1, 4).difference(
        shapely.union_all([shapely.box(3.0, -0.1, 3.1, 2.0), shapely.box(3.0, 2.55, 3.1, 4.1)])
    )
)
"""Two rooms with a door of 0.55 m."""
OUTLINE = ((0.4, 0.2), (-0.4, 0.2), (-0.4, -0.2), (0.4, -0.2))


def explored(robot, seed):
    world = World("two-rooms", ROOMS, np.array([1.2, 1.0, 0.4]), {})
    return run_trial(TrialConfig(world.name, "full-ekf", seed=seed, max_steps=250, robot=robot), world=world).summary


@pytest.mark.parametrize("seed", [1, 2])
def test_a_long_body_passes_a_door_that_it_fits_through(seed):
    found = explored(RobotConfig(outline_m=OUTLINE), seed)
    assert (found["status"], found["collisions"]) == ("complete", 0)
    assert found["coverage"] > 0.98
    assert found["contours_closed"] == 1


def test_the_disc_around_it_does_not():
    found = explored(RobotConfig(radius_m=float(np.hypot(0.4, 0.2))), 1)
    assert found["coverage"] < 0.9
    assert found["collisions"] == 0
