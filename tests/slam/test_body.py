"""The room that a body takes, against shapely."""

import numpy as np
import pytest
import shapely

from chainslam.slam.robot import RobotError, RobotSpec
from chainslam.slam.robot.body import depths_m, reaches_m

LONG = ((0.4, 0.2), (-0.3, 0.25), (-0.4, 0.0), (-0.3, -0.25), (0.4, -0.2))


def test_distances_to_an_outline_are_shapelys():
    rng, robot, body = np.random.default_rng(3), RobotSpec(outline_m=LONG), shapely.Polygon(LONG)
    points = rng.uniform(-1.0, 1.0, (400, 2))
    places = shapely.points(points)
    away = shapely.distance(body, places) - shapely.distance(body.exterior, places) * shapely.contains(body, places)
    np.testing.assert_allclose(-depths_m(points, robot), away, atol=1e-12)
    np.testing.assert_allclose(reaches_m(points, robot), robot.radius_m + away, atol=1e-12)


def test_distances_to_a_disc_are_those_from_its_middle():
    points = np.random.default_rng(4).uniform(-1.0, 1.0, (50, 2))
    assert reaches_m(points, RobotSpec()).tolist() == np.hypot(points[:, 0], points[:, 1]).tolist()
    np.testing.assert_allclose(depths_m(points, RobotSpec()), 0.2 - np.hypot(*points.T))


def test_an_outline_has_the_radius_of_its_farthest_corner_and_is_put_counter_clockwise():
    robot = RobotSpec(radius_m=1.0, outline_m=LONG[::-1])
    assert robot.radius_m == pytest.approx(np.hypot(0.4, 0.2))
    assert robot == RobotSpec(outline_m=robot.outline_m)
    assert robot.half_width_m == 0.25
    assert shapely.Polygon(robot.outline_m).exterior.is_ccw
    assert RobotSpec(radius_m=0.3).half_width_m == 0.3


@pytest.mark.parametrize(
    "corners",
    [
        ((0.4, 0.2), (-0.4, 0.2)),
        ((0.4, 0.2), (0.1, 0.0), (0.4, -0.2), (-0.4, -0.2), (-0.4, 0.2)),
        ((0.4, 0.2), (0.1, 0.2), (0.1, -0.2), (0.4, -0.2)),
        tuple((float(np.cos(t)), float(np.sin(t))) for t in 0.8 * np.pi * np.arange(5)),
        ((0.4, 0.2), (-0.4, float("nan")), (-0.4, -0.2)),
    ],
    ids=["two corners", "a notch", "beside the axle", "a star", "no number"],
)
def test_what_is_no_convex_outline_around_the_axle_is_refused(corners):
    with pytest.raises(RobotError, match=r"expected (a convex|an) outline"):
        RobotSpec(outline_m=corners)
