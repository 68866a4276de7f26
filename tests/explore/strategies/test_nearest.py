"""The three strategies of the paper against their definitions, by brute force over drawn rooms."""

import numpy as np
import pytest

from chainslam.explore.strategies import STRATEGIES
from chainslam.explore.strategies.nearest_robot import NearestRobot
from chainslam.explore.strategies.nearest_start import NearestStart
from chainslam.explore.strategies.same_chain import SameChain

SEEDS = range(8)


def drawn(scene_of, chains_of, seed):
    scene, rng = scene_of(seed), np.random.default_rng(seed)
    chains = chains_of(rng, len(scene.faces))
    return scene, rng, chains, np.append(scene.places[rng.integers(len(scene.places))], 0.0)


@pytest.mark.parametrize("seed", SEEDS)
def test_nearest_robot_takes_the_shortest_drive(scene_of, chains_of, seed):
    scene, _, chains, pose = drawn(scene_of, chains_of, seed)
    situation = scene.situation(pose, chains)
    choice = NearestRobot().choose(situation)
    row = next(k for k, end in enumerate(situation.open_ends) if end is choice.target)
    assert situation.end_metres[row] == situation.end_metres.min()
    assert f"{situation.end_metres[row]:.1f} m" in choice.reason


@pytest.mark.parametrize("seed", SEEDS)
def test_nearest_start_takes_the_end_closest_to_the_start_wherever_the_robot_is(scene_of, chains_of, seed):
    scene, _, chains, _ = drawn(scene_of, chains_of, seed)
    start, chosen = scene.places[0], set()
    for place in scene.places[1:5]:
        situation = scene.situation(np.append(place, 0.0), chains, start)
        usable = [e for e, m in zip(situation.open_ends, situation.end_metres, strict=True) if np.isfinite(m)]
        nearest = min(usable, key=lambda end: np.hypot(*(end.position_world - start)))
        target = NearestStart().choose(situation).target
        assert target is nearest
        chosen.add((target.wall, target.side))
    assert len(chosen) == 1


@pytest.mark.parametrize("seed", SEEDS)
def test_same_chain_changes_the_chain_only_when_the_actual_one_has_no_end_left(scene_of, chains_of, seed):
    """Ends are closed one by one, as they are chosen, while the robot moves about."""
    scene, rng, chains, _ = drawn(scene_of, chains_of, seed)
    strategy, done, actual = SameChain(), set(), None
    for _ in range(2 * len(chains)):
        pose = np.append(scene.places[rng.integers(len(scene.places))], 0.0)
        situation = scene.situation(pose, chains, set_aside=done)
        choice = strategy.choose(situation)
        if choice is None:
            assert not np.isfinite(situation.end_metres).any()
            return
        chain = next(c for c in chains if choice.target.wall in c)
        if actual is not None and chain != actual:
            left = [m for e, m in zip(situation.open_ends, situation.end_metres, strict=True) if e.wall in actual]
            assert not np.isfinite(left).any()
        actual = chain
        done.add((choice.target.wall, choice.target.side))
    assert len(done) == 2 * len(chains)


def test_same_chain_knows_its_chain_by_the_wall_it_follows_when_its_own_wall_is_gone(scene_of):
    """Walls that are found to be one are merged, and one of the two ids is gone."""
    scene, strategy = scene_of(1), SameChain()
    pose = np.append(scene.places[0], 0.0)
    followed = scene.situation(pose, [(0, 1)]).current_wall
    others = tuple(w for w in range(len(scene.faces)) if w != followed)
    strategy.choose(scene.situation(pose, [(followed,), others[:1]], set_aside={(others[0], 0), (others[0], 1)}))
    strategy._wall = 999
    situation = scene.situation(pose, [(followed,), others[:1]])
    if np.isfinite(situation.end_metres[:2]).any():
        assert strategy.choose(situation).target.wall == followed


@pytest.mark.parametrize("name", list(STRATEGIES))
def test_without_open_ends_and_unseen_floor_there_is_nothing_to_choose(scene_of, name):
    scene = scene_of(2)
    situation = scene.situation(np.append(scene.places[0], 0.0), [])
    situation.__dict__["frontiers"] = ()
    assert STRATEGIES[name].make().choose(situation) is None
