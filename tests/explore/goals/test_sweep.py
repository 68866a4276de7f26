"""The last layer: where it goes, and what it remembers of its visits."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.goals.ledger import Ledger
from chainslam.explore.goals.sweep import Sweep, SweepConfig
from chainslam.explore.strategies import Place


@pytest.mark.parametrize("trouble", ["", "the way was blocked"])
def test_a_border_is_visited_twice_and_what_came_of_it_is_kept(trouble):
    ledger, place = Ledger(0.3), Place(np.array([[1.0, 1.0], [1.1, 1.0]]), "unseen floor is left")
    sweep = Sweep(SweepConfig(), ledger, is_on=True)
    for _ in range(2):
        assert not sweep.was_in_vain(place.centre_world)
        sweep.ended(place, trouble)
    assert sweep.was_in_vain(place.centre_world)
    places = ledger.given_up.places
    assert [left.trouble for left in places] == [trouble, trouble]
    np.testing.assert_allclose(places[0].position_world, [1.05, 1.0])


def test_it_goes_to_unseen_floor_only_when_it_is_on(scene_of, look):
    scene = scene_of(0, 0)
    look(scene, scene.places[:1], 1.5)
    situation = scene.situation(np.append(scene.places[0], 0.0), [])
    assert Sweep(SweepConfig(), Ledger(0.3), is_on=True).choose(situation).target.kind == "unseen"
    assert Sweep(SweepConfig(), Ledger(0.3), is_on=False).choose(situation) is None


def test_where_all_floor_was_seen_it_goes_to_what_is_no_wall_of_the_map_until_one_stands_there(scene_of, look):
    """A room of 3 m, all of it seen, and a post in it that showed each scan too few beams for a line."""
    room, post = np.array([[0.0, 0], [3, 0], [3, 3], [0, 3]]), 1.4 + 0.2 * np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
    walls, faces = (np.stack([corners, np.roll(corners, -1, axis=0)], axis=1) for corners in (room, post))
    scene, pose = replace(scene_of(0, 0), faces=np.concatenate([walls, faces])), np.array([0.6, 0.6, 0.0])
    look(scene, np.array([[0.6, 0.6], [2.4, 2.4], [0.6, 2.4], [2.4, 0.6]]))
    situation, mapped = replace(scene, faces=walls).situation(pose, []), scene.situation(pose, [])
    assert not situation.frontiers
    sweep = Sweep(SweepConfig(), Ledger(0.3), is_on=True)
    choice = sweep.choose(situation)
    assert choice is not None
    assert choice.target.kind == "unexplained"
    np.testing.assert_allclose(choice.target.centre_world, [1.5, 1.5], atol=0.05)
    assert choice.holds(situation.around)
    assert not choice.holds(mapped.around)
    assert sweep.choose(mapped) is None
