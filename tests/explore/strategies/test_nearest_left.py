"""What is left when no open end is: where it goes."""

from dataclasses import replace

import numpy as np

from chainslam.explore.planning.driving_field import DrivingField
from chainslam.explore.strategies.nearest import nearest_left


def test_it_goes_to_unseen_floor_only_when_it_is_on(scene_of, look):
    scene = scene_of(0, 0)
    look(scene, scene.places[:1], 1.5)
    situation = scene.situation(np.append(scene.places[0], 0.0), [])
    assert nearest_left(situation, sweep=True).target.kind == "unseen"
    assert nearest_left(situation, sweep=False) is None


def test_where_all_floor_was_seen_it_goes_to_what_is_no_wall_of_the_map_until_one_stands_there(scene_of, look):
    """A room of 3 m, all of it seen, and a post in it that showed each scan too few beams for a line."""
    room, post = np.array([[0.0, 0], [3, 0], [3, 3], [0, 3]]), 1.4 + 0.2 * np.array([[0, 0], [0, 1], [1, 1], [1, 0]])
    walls, faces = (np.stack([corners, np.roll(corners, -1, axis=0)], axis=1) for corners in (room, post))
    scene, pose = replace(scene_of(0, 0), faces=np.concatenate([walls, faces])), np.array([0.6, 0.6, 0.0])
    look(scene, np.array([[0.6, 0.6], [2.4, 2.4], [0.6, 2.4], [2.4, 0.6]]))
    situation, mapped = replace(scene, faces=walls).situation(pose, []), scene.situation(pose, [])
    assert not situation.frontiers
    choice = nearest_left(situation, sweep=True)
    assert choice is not None
    assert choice.target.kind == "unexplained"
    np.testing.assert_allclose(choice.target.centre_world, [1.5, 1.5], atol=0.05)
    assert choice.holds(situation.around)
    assert not choice.holds(mapped.around)
    assert nearest_left(mapped, sweep=True) is None


def test_what_no_way_leads_to_is_not_chosen(scene_of, look, monkeypatch):
    scene = scene_of(0, 0)
    look(scene, scene.places[:1], 1.5)
    situation = scene.situation(np.append(scene.places[0], 0.0), [])
    assert nearest_left(situation, sweep=True) is not None
    monkeypatch.setattr(DrivingField, "metres", lambda _, places_world: np.full(len(places_world), np.inf))
    assert nearest_left(situation, sweep=True) is None
