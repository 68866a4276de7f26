"""Going on and returning: the bar, the hysteresis, and that returns come to an end."""

import networkx as nx
import numpy as np
import pytest

from explore.strategies import Place
from explore.strategies.adaptive import BAR_M, FALLEN, RAISE, Adaptive
from explore.strategies.expectation import position_sigma
from explore.strategies.nearest_robot import NearestRobot

SMALL, LARGE = 0.01, 0.08


def lost_in(scene, pose, sigma_m, known, step=1):
    """Return a situation with the position known to `sigma_m`, and with it all walls but the `known` ones."""
    count = len(scene.faces)
    common = np.zeros(3 + 2 * count)
    cov = np.diag(np.append([1e-6, 1e-6, 1e-6], np.full(2 * count, 1e-6)))
    for axis in (0, 1):
        # A shift of the robot together with all walls but the known ones: no look at those can mend it.
        common[:] = 0.0
        common[axis] = 1.0
        for wall in range(count):
            if wall not in known:
                face = scene.faces[wall]
                along = (face[1] - face[0]) / np.hypot(*(face[1] - face[0]))
                common[4 + 2 * wall] = np.array([along[1], -along[0]])[axis]
        cov += sigma_m**2 * np.outer(common, common)
    graph = nx.complete_graph(count, create_using=nx.DiGraph) if not known else nx.DiGraph()
    graph.add_edges_from((a, b) for a in known for b in known if a != b)
    return scene.situation(pose, [(k,) for k in range(count) if k not in known], cov=cov, graph=graph, step=step)


def corner_pair(scene):
    """Return two neighbouring walls of the room's outline, at right angles."""
    return (0, 1)


@pytest.mark.parametrize("seed", range(2))
def test_below_the_bar_it_explores_like_nearest_robot(scene_of, seed):
    scene = scene_of(seed)
    situation = lost_in(scene, np.append(scene.places[1], 0.0), SMALL, ())
    choice, nearest = Adaptive().choose(situation), NearestRobot().choose(situation)
    assert choice.target is nearest.target
    assert choice.reason.startswith(nearest.reason)
    assert choice.holds(situation.around)


@pytest.mark.parametrize("seed", range(2))
def test_above_the_bar_it_returns_until_the_position_is_known_well_and_then_goes_on(scene_of, seed):
    scene, strategy = scene_of(seed), Adaptive()
    pose = np.append(scene.places[1], 0.0)
    known = corner_pair(scene)
    assert not isinstance(strategy.choose(lost_in(scene, pose, SMALL, known, 0)).target, Place)
    lost = lost_in(scene, pose, LARGE, known)
    back = strategy.choose(lost)
    assert isinstance(back.target, Place)
    assert back.target.kind == "known-walls"
    assert "back" in back.reason
    assert back.holds(lost.around)
    found = lost_in(scene, pose, FALLEN * BAR_M, known)
    assert not back.holds(found.around)
    ahead = strategy.choose(found)
    assert not isinstance(ahead.target, Place)
    assert ahead.holds(found.around)
    assert not ahead.holds(lost_in(scene, pose, RAISE * LARGE + 0.02, known).around)


@pytest.mark.parametrize("seed", range(2))
def test_however_lost_the_robot_is_there_are_few_returns(scene_of, seed):
    """The bar rises by half with each: from 4 cm to 2 m there are no more than ten."""
    scene, strategy = scene_of(seed), Adaptive()
    pose = np.append(scene.places[1], 0.0)
    strategy.choose(lost_in(scene, pose, SMALL, (0, 1), 0))
    returns = 0
    for sigma in np.linspace(0.02, 2.0, 30):
        choice = strategy.choose(lost_in(scene, pose, sigma, (0, 1)))
        returns += isinstance(choice.target, Place)
    assert 1 <= returns <= np.log(2.1 / BAR_M) / np.log(RAISE) + 1


@pytest.mark.parametrize("seed", range(2))
def test_where_no_wall_is_known_better_it_goes_on(scene_of, seed):
    scene, strategy = scene_of(seed), Adaptive()
    pose = np.append(scene.places[1], 0.0)
    strategy.choose(lost_in(scene, pose, SMALL, (), 0))
    choice = strategy.choose(lost_in(scene, pose, LARGE, ()))
    assert not isinstance(choice.target, Place)


def test_what_was_uncertain_at_the_start_is_not_lost(scene_of):
    scene, strategy = scene_of(0), Adaptive()
    situation = lost_in(scene, np.append(scene.places[1], 0.0), 0.3, ())
    assert position_sigma(situation.map.belief.pose_cov) > BAR_M
    for _ in range(2):
        assert not isinstance(strategy.choose(situation).target, Place)
