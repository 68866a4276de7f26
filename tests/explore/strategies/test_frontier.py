"""Frontiers: borders of seen floor as long as there are any, then open ends."""

from dataclasses import replace

import numpy as np
import pytest
from scipy.ndimage import binary_dilation

from chainslam.explore.strategies import Place
from chainslam.explore.strategies.frontier import Frontier
from chainslam.explore.strategies.nearest_robot import NearestRobot

SEEDS = range(5)


def glimpsed(scene_of, look, seed):
    """Return a room that was seen from one place only, 1.5 m around."""
    scene = scene_of(seed, 0)
    look(scene, scene.places[:1], 1.5)
    return scene, scene.situation(np.append(scene.places[0], 0.0), [(0, 1)])


@pytest.mark.parametrize("seed", SEEDS)
def test_borders_are_where_floor_that_can_be_driven_to_meets_unseen_floor(scene_of, look, seed):
    """Brute force by dilation of the unknown floor; borders of fewer than four cells are left out."""
    scene, situation = glimpsed(scene_of, look, seed)
    beside = np.argwhere(binary_dilation(scene.grid.evidence == 0))
    cells = {tuple(c) for place in situation.frontiers for c in scene.grid.cells(place.points_world).tolist()}
    every = {tuple(c) for c in beside[situation.field.can_stay(beside)].tolist()}
    assert cells <= every
    assert len(every - cells) < 4 * max(len(situation.frontiers), 1)
    assert cells


@pytest.mark.parametrize("seed", SEEDS)
def test_a_frontier_is_chosen_before_any_open_end_and_holds_until_it_is_seen(scene_of, look, seed):
    scene, situation = glimpsed(scene_of, look, seed)
    choice = Frontier().choose(situation)
    assert isinstance(choice.target, Place)
    assert choice.holds(situation.around)
    metres = [situation.field.metres(place.points_world).min() for place in situation.frontiers]
    assert situation.field.metres(choice.target.points_world).min() == min(metres)
    look(scene, scene.places)
    assert not choice.holds(situation.around)


@pytest.mark.parametrize("seed", SEEDS)
def test_when_no_frontier_is_left_the_open_ends_follow_nearest_first(scene_of, seed):
    scene = scene_of(seed)
    situation = scene.situation(np.append(scene.places[0], 0.0), [(0, 1), (2,)])
    situation.__dict__["frontiers"] = ()
    choice, nearest = Frontier().choose(situation), NearestRobot().choose(situation)
    assert (choice is None) == (nearest is None) == (not np.isfinite(situation.end_metres).any())
    if choice is None:
        return
    assert choice.target is nearest.target
    assert choice.reason.endswith(nearest.reason)


def test_borders_that_were_visited_in_vain_are_no_goals(scene_of, look):
    _, situation = glimpsed(scene_of, look, 0)
    assert situation.frontiers
    assert replace(situation, was_in_vain=lambda place: True).frontiers == ()
