"""Limits, the way home, and the certificate that a mission leaves."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest
import shapely

from chainslam.explore.certificate import certify
from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.goal import GivenUp, LeftPlace
from chainslam.explore.goals.explorer import Explorer
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.explore.goals.homing import Homing, HomingConfig
from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import MissionConfig, explore_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.planning.passable import PathConfig
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.map.chains import connect
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Scan
from tests.explore.rings import closed_map

ROOM = shapely.orient_polygons(shapely.box(0, 0, 4, 4).difference(shapely.box(1.7, 1.6, 2.4, 2.3)))
START = np.array([0.7, 0.7, 0.3])
WAY = START[None, :2]


def begun():
    world = World("drawn", ROOM, START, {})
    backend = BACKENDS["full-ekf"].make(START.copy(), np.diag([0.01, 0.01, 0.002]) ** 2)
    return SimulatedRobot(world, 1, errorless=True), backend


def steps(**changes):
    robot, backend = begun()
    return explore_mission(robot, Mapper(backend), STRATEGIES["nearest-robot"].make(), MissionConfig(**changes)), robot


def leaving(step, places):
    """Return a step at which these places were left."""
    given_up = GivenUp(places=places, near_m=ExplorerConfig().near_m)
    return replace(step, decision=replace(step.decision, given_up=given_up))


@pytest.mark.parametrize(
    ("limits", "outcome", "word"),
    [
        (Limits(steps=7), Outcome.STEP_LIMIT, "7 steps"),
        (Limits(path_m=0.5), Outcome.PATH_LIMIT, "0.5 m"),
        (Limits(time_s=3.0), Outcome.TIME_LIMIT, "3 s"),
    ],
    ids=str,
)
def test_a_limit_ends_a_mission_at_the_first_step_that_reaches_it(limits, outcome, word):
    mission, _ = steps()
    *before, last = limited(mission, limits)
    assert (last.outcome, last.ended, last.decision.command) == (outcome, "stopped", None)
    assert word in last.decision.words
    assert all(step.outcome is None and limits.reached(step) is None for step in before)
    reached = {"step": last.index + 1 == 7, "path": last.path_length_m >= 0.5, "time": last.time_s >= 3.0}
    assert reached[outcome.split("-")[0]]


def test_a_mission_ends_where_it_began_and_its_certificate_holds_the_room_and_the_island():
    mission, robot = steps(return_to_start=True)
    *_, last = mission
    assert last.outcome is Outcome.ALL_CLOSED
    assert "back at the start" in last.decision.words
    assert np.hypot(*(robot.true_pose - START)[:2]) <= 0.2
    certificate = certify(last, last.outcome, PathConfig(), True, WAY)
    assert sorted(contour.is_island for contour in certificate.contours) == [False, True]
    assert all(contour.polygon.is_valid for contour in certificate.contours)
    assert certificate.floor_m2 == pytest.approx(ROOM.area, abs=0.05)
    assert certificate.open_ends == ()
    assert certificate.frontiers == ()
    assert certificate.obstacles == ()
    assert certificate.unseen_m2 == pytest.approx(0.0, abs=0.02)


def test_a_robot_that_cannot_drive_again_where_it_has_been_is_told_so():
    mission, _ = steps()
    way = []
    for step in mission:
        way.append(step.pose_world[:2])
        last = step
    way = np.array(way)
    assert certify(last, last.outcome, PathConfig(), True, way).reachable_way == 1.0
    # A wall all along y = 2 from wall to wall, as a map that has turned would draw it.
    cells = last.free_space.cells(np.stack([np.arange(0.0, 4.0, 0.02), np.full(200, 2.0)], axis=-1))
    last.free_space.evidence[tuple(cells.T)] = 6
    last.free_space._mark(*np.array([cells.min(axis=0), cells.max(axis=0) + 1]).T.ravel().tolist())
    here = way[:, 1] > 2.0 if last.pose_world[1] > 2.0 else way[:, 1] < 2.0
    share = certify(last, last.outcome, PathConfig(), True, way).reachable_way
    assert share == pytest.approx(here.mean(), abs=0.1)
    assert share < 0.9


def test_what_a_stopped_mission_has_not_seen_yet_is_told():
    mission, _ = steps()
    *_, last = limited(mission, Limits(steps=2))
    certificate = certify(last, last.outcome, PathConfig(), True, WAY)
    assert {end.why for end in certificate.open_ends} == {"not explored yet"}
    assert len(certificate.open_ends) == sum(len(chain.open_ends) for chain in last.chains) > 0
    assert certificate.frontiers
    assert {border.why for border in certificate.frontiers} == {"not visited yet"}
    assert all(border.length_m >= 0.2 for border in certificate.frontiers)


def test_each_border_of_unseen_floor_is_left_with_what_came_of_its_own_visits():
    mission, _ = steps()
    *_, last = limited(mission, Limits(steps=2))
    borders = certify(last, last.outcome, PathConfig(), True, WAY).frontiers
    assert borders
    near, far = borders[0].cells_world.mean(axis=0), borders[0].cells_world.mean(axis=0) + 5.0
    for troubles, words in (
        ([(near, ""), (near, "")], "visited 2 times"),
        ([(near, ""), (near, "the way was blocked")], "not reached: the way was blocked"),
        ([(far, "the way was blocked")], "not visited yet"),
    ):
        left = tuple(LeftPlace(place, trouble) for place, trouble in troubles)
        certificate = certify(leaving(last, left), last.outcome, PathConfig(), True, WAY)
        assert words in certificate.frontiers[0].why
    without = certify(leaving(last, left), last.outcome, PathConfig(), False, WAY)
    assert {border.why for border in without.frontiers} == {"unseen floor was not to be visited"}


def test_what_stands_and_is_no_wall_of_the_map_is_told():
    mission, _ = steps()
    *_, last = mission
    # In the middle of the floor, something that the beams met and no wall accounts for.
    free = last.free_space.points(np.argwhere(last.free_space.evidence < 0))
    lonely = free[np.argmax(distance_to_segments(free, last.map.ends_world).min(axis=1))]
    cells = last.free_space.cells(lonely + 0.05 * np.array([[0.0, 0.0], [1.0, 0.0], [0.0, 1.0]]))
    last.free_space.evidence[tuple(cells.T)] = 6
    for troubles, sweep, words in (
        ([], True, "not visited yet"),
        (["", ""], True, "visited 2 times, and no scan from there shows a wall"),
        (["no way leads there"], True, "not reached: no way leads there"),
        ([""], False, "what is no wall of the map was not to be looked at"),
    ):
        left = tuple(LeftPlace(lonely, trouble) for trouble in troubles)
        (thing,) = certify(leaving(last, left), last.outcome, PathConfig(), sweep, WAY).obstacles
        assert len(thing.cells_world) == 3
        assert thing.why == words


def test_a_start_that_cannot_be_reached_again_is_told():
    mission, _ = steps()
    *_, last = mission
    explorer = Explorer(STRATEGIES["nearest-robot"].make(), START[:2], replace(ExplorerConfig(), first_turns=0))
    homing = Homing(explorer, np.array([2.0, 2.0]), HomingConfig(), ExplorerConfig().following)
    around = Surroundings(last.map, last.free_space, last.scan)
    decision = homing.decide(around, last.chains, nx.DiGraph())
    assert decision.command is None
    assert "the start cannot be reached" in decision.words


def test_the_last_two_ends_to_be_given_up_may_still_join():
    """Between them a short face was missed, and neither can be looked at: the next scan's chains are closed."""
    ring = np.array([[0.0, 0.0], [2.0, 0.0], [2.0, 2.0], [0.0, 2.0]])
    walls, _ = closed_map(ring)
    walls.extents[0, 1] -= 0.25
    scan = Scan(np.linspace(-3.1, 3.1, 180), np.full(180, 0.15), 0.01, 4.0, 0.0)
    around = Surroundings(walls, FreeSpace(), scan)
    around.free_space.integrate(walls.belief.pose_world, scan)
    explorer = Explorer(STRATEGIES["nearest-robot"].make(), START[:2], replace(ExplorerConfig(), first_turns=0))
    before = connect(walls)
    assert [chain.is_closed for chain in before] == [False]
    decision = explorer.decide(around, before, nx.DiGraph())
    assert decision.given_up.keys == {(end.wall, end.side) for end in before[0].open_ends}
    assert decision.command is not None
    after = connect(walls, decision.given_up.keys)
    assert [chain.is_closed for chain in after] == [True]
    decision = explorer.decide(around, after, nx.DiGraph())
    assert (decision.command, decision.outcome) == (None, Outcome.ALL_CLOSED)


def test_an_end_that_opens_and_closes_without_end_is_set_aside_with_its_reason(scene_of):
    """Seen from where the robot looks at it the chain is closed, seen from anywhere else it is not."""
    scene = scene_of(3)
    pose = np.append(scene.places[0], 0.0)
    sides = [scene.situation(pose, chains) for chains in ([(0, 1)], [])]
    config = replace(ExplorerConfig(), sweep=False, patience_m=3.0)
    explorer = Explorer(STRATEGIES["nearest-robot"].make(), pose[:2], config)
    for turn in range(200):
        situation = sides[turn % 2]
        decision = explorer.decide(situation.around, situation.chains, nx.DiGraph())
        if decision.command is None and turn % 2 == 0:
            break
    assert config.patience_steps < turn < 199
    assert decision.outcome is Outcome.NONE_REACHABLE
    assert len(decision.given_up.ends) == 2
    assert all(
        f"still open after {config.patience_steps + 1} steps" in aside.reason for aside in decision.given_up.ends
    )


def test_a_mission_does_not_end_before_every_end_has_its_reason():
    """More ends than one step has attempts for: in a door one noisy scan refused them all, and half was unseen."""
    angle = 2 * np.pi * np.arange(24) / 24
    walls, _ = closed_map(8.0 * np.stack([np.cos(angle), np.sin(angle)], axis=-1))
    walls.extents[:, 0] += 0.5
    walls.extents[:, 1] -= 0.5
    scan = Scan(np.linspace(-3.1, 3.1, 180), np.full(180, 0.15), 0.01, 4.0, 0.0)
    around = Surroundings(walls, FreeSpace(), scan)
    around.free_space.integrate(walls.belief.pose_world, scan)
    explorer = Explorer(STRATEGIES["nearest-robot"].make(), START[:2], ExplorerConfig())
    given_up = GivenUp()
    for _ in range(20):
        chains = connect(walls, given_up.keys)
        decision = explorer.decide(around, chains, nx.DiGraph())
        given_up = decision.given_up
        if decision.command is None:
            break
    ends = {(end.wall, end.side) for chain in chains for end in chain.open_ends}
    assert len(ends) == 48
    assert given_up.keys == ends
