"""How long the explorer keeps at one thing: a goal, an end that comes back, walls that it saw only once."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest

from chainslam.explore.goals.explorer import Explorer
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.explore.strategies import STRATEGIES

NO_SWEEP = replace(ExplorerConfig(), sweep=False)


def told_at(scene, config):
    """Return where the robot stands in a scene, and an explorer there."""
    pose = np.append(scene.places[0], 0.0)
    return pose, Explorer(STRATEGIES["nearest-robot"].make(), pose[:2], config)


def ask(explorer, situation):
    """Return the command, and the ends that are set aside."""
    decision = explorer.decide(situation.around, situation.chains, nx.DiGraph())
    return decision.command, decision.given_up.ends


@pytest.mark.parametrize("patience", [3, 8])
def test_a_goal_that_takes_too_long_is_set_aside_and_says_so(scene_of, patience):
    """The wheels do not carry the robot: whatever it does, it stands where it stood."""
    scene = scene_of(3)
    pose, explorer = told_at(scene, replace(NO_SWEEP, patience_m=patience * 0.15))
    situation = scene.situation(pose, [(0, 1)])
    for _ in range(patience):
        command, aside = ask(explorer, situation)
        assert command is not None
        assert not aside
    assert [end.reason for end in ask(explorer, situation)[1]] == [f"not reached in {patience} steps"]


def test_an_end_that_was_given_up_is_tried_again_where_it_moved_but_three_times_only(scene_of):
    """It goes to and fro by 0.25 m, and each time it might be a new one."""
    scene = scene_of(3)
    pose, explorer = told_at(scene, replace(NO_SWEEP, patience_m=0.0))
    tried, before = [], ()
    for turn in range(12):
        situation = scene.situation(pose, [(0, 1)])
        (chain,) = situation.chains
        shift = 0.25 * (turn % 2) * np.array([1.0, 0.0])
        ends = tuple(replace(end, position_world=end.position_world + shift) for end in chain.open_ends)
        _, aside = ask(explorer, replace(situation, chains=(replace(chain, open_ends=ends),)))
        tried.append(any(end not in before for end in map(id, aside)))
        before, kept = set(map(id, aside)), aside
    attempts = NO_SWEEP.attempts
    assert tried == [True] * attempts + [False] * (12 - attempts)
    assert len(kept) == 2


@pytest.mark.parametrize("is_tentative", [True, False])
def test_before_it_ends_the_robot_looks_again_while_there_are_walls_that_it_saw_only_once(scene_of, is_tentative):
    scene = scene_of(3)
    pose, explorer = told_at(scene, NO_SWEEP)
    situation = scene.situation(pose, [])
    situation.map.tentative[0] = is_tentative
    looks = [ask(explorer, situation)[0] for _ in range(NO_SWEEP.second_looks)]
    assert ask(explorer, situation)[0] is None
    for command in looks:
        assert (command is not None) == is_tentative
        assert command is None or (command.forward_m == 0.0 and command.turn_rad != 0.0)
