"""How long the explorer keeps at one thing: a goal, an end that comes back."""

from dataclasses import replace

import networkx as nx
import numpy as np
import pytest

from chainslam.explore.goals.explorer import Explorer
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.explore.strategies import STRATEGIES

NO_SWEEP = replace(ExplorerConfig(), sweep=False, first_turns=0)


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


def test_an_end_that_comes_and_goes_is_set_aside_once_its_place_took_the_patience(scene_of):
    """It is gone at each second step, and whatever wall it comes back on, it is the same place."""
    scene, patience = scene_of(3), 6
    pose, explorer = told_at(scene, replace(NO_SWEEP, patience_m=patience * 0.15))
    situation = scene.situation(pose, [(0, 1)])
    (chain,) = situation.chains
    (end, *_) = chain.open_ends
    for turn in range(patience + 1):
        there = replace(situation, chains=(replace(chain, open_ends=(replace(end, wall=turn % 2),)),))
        assert not ask(explorer, there)[1]
        ask(explorer, replace(situation, chains=()))
    reasons = [each.reason for each in ask(explorer, there)[1]]
    assert reasons == [f"still open after {patience + 1} steps there"]


@pytest.mark.parametrize(("apart", "is_one_place"), [(0.9, True), (1.1, False)])
def test_steps_are_counted_for_all_ends_that_are_near_each_other(scene_of, apart, is_one_place):
    """The end comes back as often as it goes, now here and now there."""
    scene, patience = scene_of(3), 6
    config = replace(NO_SWEEP, patience_m=patience * 0.15)
    pose, explorer = told_at(scene, config)
    situation = scene.situation(pose, [(0, 1)])
    (chain,) = situation.chains
    (end, *_) = chain.open_ends
    shift = np.array([apart * config.near_m, 0.0])
    for turn in range(patience + 2):
        moved = replace(end, wall=turn % 2, position_world=end.position_world + shift * (turn % 2))
        aside = ask(explorer, replace(situation, chains=(replace(chain, open_ends=(moved,)),)))[1]
        ask(explorer, replace(situation, chains=()))
    assert bool(aside) == is_one_place
