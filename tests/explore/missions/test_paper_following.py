"""Missions by the paper's three layers: a wall that is the end of a chain, the walls that lead there, one at a time."""

from collections import Counter
from functools import cache
from itertools import pairwise

import numpy as np
import pytest

from chainslam.explore.following.behaviour import Behaviour
from chainslam.explore.following.end_errand import EndErrand
from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.explore.limits import Limits, limited
from chainslam.explore.mission import MissionConfig, explore_mission
from chainslam.explore.outcome import Outcome
from chainslam.explore.strategies import STRATEGIES
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper

P0 = np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2
FOLLOWED = {Behaviour.APPROACH, Behaviour.FOLLOW, Behaviour.ROUND, Behaviour.REVERSE}


def mission(world, navigation="visibility", ping_pongs=1, seed=1, errorless=True, max_steps=1500):
    drawn = load(world)
    robot = SimulatedRobot(drawn, seed, errorless)
    following = FollowingConfig(method="paper", navigation=navigation, ping_pongs=ping_pongs)
    config = MissionConfig(explorer=ExplorerConfig(following=following, sweep=False))
    mapper = Mapper(BACKENDS["full-ekf"].make(drawn.start.copy(), P0.copy()))
    steps = limited(explore_mission(robot, mapper, STRATEGIES["nearest-robot"].make(), config), Limits(steps=max_steps))
    seen = []
    for step in steps:
        edges = set(step.graph.edges)
        seen.append((step, edges))
    return seen, robot


@cache
def figure_9(seed=0):
    """Without noise for seed 0: which of two ways that are alike is taken then depends on a machine's last bits."""
    return mission("paper-fig9", seed=max(seed, 1), errorless=not seed)


def test_figure_9_is_explored_by_following_walls_and_the_ping_pong_turns_back():
    """In each of these runs the robot turns back along a wall of its map, and goes on to its other end."""
    turned_back = 0
    for seed in range(3):
        seen, robot = figure_9(seed)
        assert seen[-1][0].outcome is Outcome.ALL_CLOSED
        assert robot.record.collisions == 0
        counts = Counter(step.decision.behaviour for step, _ in seen)
        assert all(counts[word] > 0 for word in FOLLOWED)
        assert sum(counts[word] for word in FOLLOWED) >= len(seen) - 8
        turned_back += turns(seen)
    assert turned_back >= 3


def turns(seen):
    """Along how many walls the robot turned back, having gone on each time."""
    reversed_walls = {
        step.decision.walls_to_follow[0] for step, _ in seen if step.decision.behaviour is Behaviour.REVERSE
    }
    for wall in reversed_walls:
        words = [s.decision.behaviour for s, _ in seen if s.decision.walls_to_follow[:1] == (wall,)]
        changes = [b for a, b in pairwise([None, *words]) if a is not b]
        turned = changes.index(Behaviour.REVERSE)
        assert {Behaviour.FOLLOW, Behaviour.ROUND} & set(changes[turned + 1 :])
    return len(reversed_walls)


def test_each_goal_is_a_wall_that_begins_or_ends_a_chain_and_the_last_to_be_followed():
    seen, _ = figure_9()
    for step, _ in seen:
        goal = step.decision.goal
        if goal is None:
            continue
        open_walls = {end.wall for chain in step.chains for end in chain.open_ends}
        assert goal.wall in open_walls
        assert step.decision.walls_to_follow[-1] == goal.wall


def test_a_sequence_follows_edges_of_the_visibility_graph():
    longest = 0
    for seed in range(3):
        planned = ()
        for step, edges in figure_9(seed)[0]:
            walls = step.decision.walls_to_follow
            if walls != planned[len(planned) - len(walls) :]:  # planned at this step
                assert all(pair in edges for pair in pairwise(walls))
            longest, planned = max(longest, len(walls)), walls
    assert longest >= 2


def test_no_viewpoint_is_looked_at(monkeypatch):
    def refused(*_):
        raise AssertionError("a viewpoint was asked for")

    monkeypatch.setattr(EndErrand, "_plan", refused)
    seen, _ = mission("paper-fig8")
    assert seen[-1][0].outcome is Outcome.ALL_CLOSED


@pytest.mark.parametrize("navigation", ["floor", "visibility"])
@pytest.mark.parametrize("seed", [1, 2])
def test_with_noise_and_by_either_navigation_figure_4_is_explored_untouched(navigation, seed):
    seen, robot = mission("paper-fig4", navigation, seed=seed, errorless=False)
    assert seen[-1][0].ended == "complete"
    assert robot.record.collisions == 0
