"""Every strategy explores to the end, gives its reasons, and can be exchanged while the robot drives."""

import numpy as np
import pytest
import shapely

from chainslam.explore.floor.free_space import FreeSpace
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.goal import GivenUp
from chainslam.explore.goals.explorer import Explorer
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import explore_mission
from chainslam.explore.planning.visibility_graph import VisibilityGraph
from chainslam.explore.strategies import STRATEGIES, Strategy
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper

pytestmark = pytest.mark.usefixtures("_unchecked")
P0 = np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2


def two_rooms():
    """Return two rooms with a door between them, and a block in the second."""
    free = (
        shapely.box(0, 0, 6, 3).difference(shapely.box(2.9, 1.1, 3.0, 3.0)).difference(shapely.box(4.2, 1.2, 4.8, 1.8))
    )
    return World("drawn", shapely.orient_polygons(free), np.array([0.8, 1.9, 0.2]), {})


def robot_and_backend(world, errorless):
    return SimulatedRobot(world, 1, errorless), BACKENDS["full-ekf"].make(world.start.copy(), P0.copy())


@pytest.mark.parametrize("name", list(STRATEGIES))
def test_every_strategy_closes_all_chains_without_touching_a_wall(name):
    robot, backend = robot_and_backend(two_rooms(), errorless=False)
    steps = list(limited(explore_mission(robot, Mapper(backend), STRATEGIES[name].make()), Limits(steps=1500)))
    assert steps[-1].ended == "complete"
    assert robot.record.collisions == 0
    assert sum(chain.is_closed for chain in steps[-1].chains) == 2
    for step in steps[:-1]:
        if step.decision.goal is not None:
            assert step.decision.goal.reason
            assert step.decision.goal.reason in step.decision.words


@pytest.mark.parametrize("name", list(STRATEGIES))
def test_what_is_in_the_registry_keeps_the_protocol_and_shares_no_memory(name):
    one, other = STRATEGIES[name].make(), STRATEGIES[name].make()
    assert isinstance(one, Strategy)
    assert one is not other
    assert STRATEGIES[name].description


class Asked:
    """A strategy that counts how often it was asked."""

    def __init__(self, inner):
        self.inner, self.times = inner, 0

    def choose(self, situation):
        self.times += 1
        return self.inner.choose(situation)


def test_a_strategy_that_is_exchanged_on_the_way_is_asked_from_then_on():
    robot, backend = robot_and_backend(two_rooms(), errorless=True)
    first, second = (Asked(STRATEGIES[name].make()) for name in ("nearest-robot", "frontier"))
    mapper, graph, floor = Mapper(backend), VisibilityGraph(), FreeSpace()
    explorer = Explorer(first, backend.belief.pose_world[:2].copy(), ExplorerConfig())
    given_up, goal = GivenUp(), None
    for index in range(1500):
        scan = robot.sense()
        update = mapper.step(scan, given_up.keys)
        floor.integrate(update.map.belief.pose_world, scan)
        graph.observe(update.map, update.chains, None, [])
        if index == 30:
            asked, before = first.times, goal
            explorer.strategy = second
        decision = explorer.decide(Surroundings(update.map, floor, scan), update.chains, graph.graph)
        command, goal, given_up = decision.command, decision.goal, decision.given_up
        if index == 30:
            assert second.times == 1
            assert goal is not before
        if command is None:
            break
        mapper.predict(robot.drive(command))
    assert first.times == asked > 0
    assert second.times > 1
    assert all(chain.is_closed for chain in update.chains)
