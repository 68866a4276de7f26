"""Going on and turning back: by what the belief must have wrong, to walls known from the start, once for each end."""

from dataclasses import replace
from itertools import islice

import networkx as nx
import numpy as np
import pytest

from chainslam.explore.mission import explore_mission
from chainslam.explore.strategies import Place, Watchful, make_strategy
from chainslam.explore.strategies.adaptive import Adaptive
from chainslam.explore.strategies.nearest_robot import NearestRobot
from chainslam.sim.robot import SimulatedRobot
from chainslam.sim.worlds import load
from chainslam.slam.backends import BACKENDS
from chainslam.slam.mapper import Mapper

KNOWN = (0, 1)


def looked(scene, strategy, overconfident, seen=(5,)):
    """Let a strategy see the known walls and then others on its way; return the situation at the end.

    An overconfident belief claims to know everything a hundred times as well as the start was known.
    """
    size = 3 + 2 * len(scene.faces)
    start = np.eye(size) * (0.01**2 if overconfident else 1e-12)
    cov = np.eye(size) * (0.0001**2 if overconfident else 0.001**2)
    places = np.linspace(scene.places[0], scene.places[1], 8)
    chains = [(k,) for k in range(len(scene.faces)) if k not in KNOWN]

    def situation(place, cov, seen):
        made = scene.situation(np.append(place, 0.0), chains, cov=cov, graph=nx.DiGraph())
        return replace(made, around=replace(made.around, seen=seen))

    strategy.watch(situation(places[0], start, KNOWN).around)
    for place in places:
        last = situation(place, cov, seen)
        strategy.watch(last.around)
    return last


@pytest.mark.parametrize("seed", range(2))
def test_with_an_honest_belief_it_explores_like_nearest_robot(scene_of, seed):
    strategy = Adaptive()
    situation = looked(scene_of(seed), strategy, overconfident=False)
    for _ in range(3):
        choice, nearest = strategy.choose(situation), NearestRobot().choose(situation)
        assert choice.target is nearest.target
        assert choice.reason.startswith(nearest.reason)
        assert choice.holds(situation.around)


@pytest.mark.parametrize("seed", range(2))
def test_with_an_overconfident_one_it_turns_back_to_a_known_wall_once_for_each_end(scene_of, seed):
    strategy = Adaptive()
    situation = looked(scene_of(seed), strategy, overconfident=True)
    for _ in range(3):
        back, ahead = strategy.choose(situation), strategy.choose(situation)
        assert isinstance(back.target, Place)
        assert back.target.kind == "known-walls"
        assert any(f"wall {wall} is well known" in back.target.what for wall in KNOWN)
        assert "back" in back.reason
        assert not isinstance(ahead.target, Place)


def test_of_the_known_walls_it_turns_back_to_the_nearest(scene_of):
    scene, strategy = scene_of(0), Adaptive()
    situation = looked(scene, strategy, overconfident=True)
    back = strategy.choose(situation)
    metres = [
        situation.field.metres(scene.situation(situation.around.pose_world, [(wall,)]).map.ends_world[wall]).min()
        for wall in KNOWN
    ]
    assert situation.field.metres(back.target.points_world).min() <= min(metres) + 1.0


def test_in_sight_of_a_known_wall_it_goes_on(scene_of):
    strategy = Adaptive()
    situation = looked(scene_of(0), strategy, overconfident=True, seen=(0, 5))
    assert not isinstance(strategy.choose(situation).target, Place)


def test_what_it_sees_beside_a_known_wall_after_a_return_is_known_from_then_on(scene_of):
    scene, strategy = scene_of(0), Adaptive()
    situation = looked(scene, strategy, overconfident=True)
    assert isinstance(strategy.choose(situation).target, Place)
    home = replace(situation, around=replace(situation.around, seen=(1, 4)))
    strategy.watch(home.around)
    strategy.choose(home)
    again = replace(situation, around=replace(situation.around, seen=(4, 5)))
    strategy.watch(again.around)
    assert not isinstance(strategy.choose(again).target, Place)
    assert not isinstance(strategy.choose(again).target, Place)


def test_where_no_known_wall_can_be_reached_it_goes_on(scene_of):
    scene, strategy = scene_of(0), Adaptive()
    situation = looked(scene, strategy, overconfident=True)
    strategy._monitor.known = {10_000}
    assert not isinstance(strategy.choose(situation).target, Place)


def test_in_a_schedule_it_watches_before_its_turn_comes():
    assert isinstance(make_strategy("adaptive"), Watchful)
    assert not isinstance(make_strategy("nearest-robot"), Watchful)


def test_a_schedule_hands_every_step_on(scene_of):
    scheduled = make_strategy("nearest-robot,adaptive@1")
    looked(scene_of(0), scheduled, overconfident=True)
    adaptive = scheduled._parts[1][1]
    assert adaptive._monitor.known == set(KNOWN)


class Listener(NearestRobot):
    """Keeps what it is told."""

    def __init__(self):
        self.heard = []

    def watch(self, around):
        self.heard.append(around)


def test_a_watchful_strategy_is_told_what_every_step_sees():
    world, listener = load("paper-fig4"), Listener()
    backend = BACKENDS["full-ekf"].make(np.array(world.start), np.diag([0.01, 0.01, 0.002]) ** 2)
    steps = list(islice(explore_mission(SimulatedRobot(world, 1), Mapper(backend), listener), 15))
    assert len(listener.heard) == len(steps)
    for around, step in zip(listener.heard, steps, strict=True):
        assert around.odometry is step.odometry
        assert around.seen == tuple(np.unique(step.walls_of_segments[step.walls_of_segments >= 0]).tolist())
    squared, dof = np.array([(around.nis.squared, around.nis.dof) for around in listener.heard]).T
    assert dof[0] == 0
    assert dof[1:].min() >= 2
    assert 0.5 < squared.sum() / dof.sum() < 1.5
