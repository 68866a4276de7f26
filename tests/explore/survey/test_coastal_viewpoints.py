"""Floor amid a hall is looked at with walls in sight, as long as there is such a place; then anyway; then left."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from chainslam.explore.goals.ledger import Ledger
from chainslam.explore.goals.sweep import Sweep, SweepConfig
from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import explore_mission
from chainslam.explore.planning.driving_field import DrivingField
from chainslam.explore.strategies import STRATEGIES
from chainslam.explore.survey.coastal_viewpoints import coastal_viewpoints
from chainslam.explore.survey.frontiers import PIECE_M, frontiers, pieces
from chainslam.explore.survey.trusted_walls import TrustedWalls
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.mapper import Mapper

COAST_M = 3.0
REACH_M = 3.2


def test_a_border_is_cut_into_squares_and_nothing_is_lost():
    points = np.random.default_rng(1).uniform(-5.0, 5.0, (300, 2))
    found = pieces(points)
    assert np.all(np.ptp(np.array([[t.min(axis=0), t.max(axis=0)] for t in found]), axis=1) <= PIECE_M)
    np.testing.assert_allclose(np.unique(np.concatenate(found), axis=0), np.unique(points, axis=0))


def test_the_places_have_walls_near_see_the_floor_and_can_be_driven_to(hall):
    start, pose = hall.places[0], np.append(hall.places[0], 0.0)
    walls = TrustedWalls(hall.walls(pose))
    field = DrivingField(hall.grid, start, hall.situation(pose, []).following.paths)
    count = 0
    for border in frontiers(hall.grid, field):
        assert not walls.near(border, COAST_M).any(), "from beside the walls all floor near them was seen"
        for tile in pieces(border):
            places = coastal_viewpoints(tile.mean(axis=0), walls, COAST_M, REACH_M, hall.grid, field)
            count += len(places)
            assert len(places), "every piece of this border shows from the coast"
            assert np.all(distance_to_segments(places, hall.faces).min(axis=1) <= COAST_M)
            assert np.all(np.hypot(*(places - tile.mean(axis=0)).T) <= REACH_M + 1e-9)
            assert np.all(np.isfinite(field.metres(places)))
    assert count > 20
    tentative = replace(hall.walls(pose), tentative=np.ones(len(hall.faces), dtype=bool))
    assert not TrustedWalls(tentative).near(hall.places, COAST_M).any(), "a wall seen once is no coast"


def test_looks_from_the_coast_come_first_and_each_once_then_visits_and_then_an_end(hall):
    """Nothing of what is unseen becomes seen here: the worst case."""
    ledger, pose = Ledger(0.3), np.append(hall.places[0], 0.0)
    sweep, on_the_coast = Sweep(SweepConfig(), ledger, is_on=True), []
    while True:
        choice = sweep.choose(replace(hall.situation(pose, []), was_in_vain=sweep.was_in_vain))
        if choice is None:
            break
        assert choice.target.kind == "unseen"
        on_the_coast.append(TrustedWalls(hall.walls(pose)).near(choice.target.points_world, COAST_M).all())
        sweep.ended(choice.target, "")
        assert len(on_the_coast) < 200
    first_visit = on_the_coast.index(False)
    assert first_visit > 5
    assert not any(on_the_coast[first_visit:])
    assert len(ledger.given_up.places) == len(on_the_coast) - first_visit, "a look from afar is no visit"


@pytest.mark.long
def test_amid_a_hall_the_robot_drives_little_without_a_wall_in_sight():
    """Where it went to the nearest unseen floor first it drove 9.4 m so."""
    room = shapely.orient_polygons(shapely.box(0, 0, 18, 16.7))
    start = np.array([0.7, 0.7, 0.3])
    robot = SimulatedRobot(World("drawn", room, start, {}), 1, errorless=True)
    backend = BACKENDS["full-ekf"].make(start.copy(), np.diag([0.01, 0.01, 0.002]) ** 2)
    mission = limited(explore_mission(robot, Mapper(backend), STRATEGIES["nearest-robot"].make()), Limits(steps=1500))
    places = [start[:2], *(robot.true_pose[:2].copy() for _ in mission)]
    assert len(places) < 1500
    moved = np.hypot(*np.diff(places, axis=0).T)
    blind = shapely.distance(room.exterior, shapely.points(places[1:])) > 4.0
    assert 0.0 < moved[blind].sum() < 6.0
