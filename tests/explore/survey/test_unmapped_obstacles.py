"""Things that stopped beams and are no wall of the map are looked at from nearby before a mission ends."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.planning.driving_field import DrivingField
from chainslam.explore.strategies.nearest import nearest_left
from chainslam.explore.survey.unmapped_obstacles import (
    APART_M,
    LOOK_BEYOND_M,
    is_mapped,
    obstacle_viewpoints,
    unmapped_obstacles,
)
from chainslam.slam.geometry.lines import distance_to_segments


def without_some(scene, rng):
    """Return the map without the faces of one block inside the room, and those faces."""
    inner = np.flatnonzero(np.all((scene.faces > 0.01) & (scene.faces < 5.99), axis=(1, 2)))
    gone = np.zeros(len(scene.faces), dtype=bool)
    middle = scene.faces[rng.choice(inner)].mean(axis=0)
    gone[inner] = np.hypot(*(scene.faces[inner].mean(axis=1) - middle).T) < 0.8
    return replace(scene, faces=scene.faces[~gone]), scene.faces[gone]


@pytest.mark.parametrize("seed", range(6))
def test_what_is_found_was_hit_and_is_no_wall_of_the_map(scene_of, seed):
    whole, rng = scene_of(seed), np.random.default_rng(seed)
    pose = np.append(whole.places[0], 0.0)
    assert not unmapped_obstacles(whole.grid, whole.walls(pose)), "all that was hit is a wall of the map"
    some, gone = without_some(whole, rng)
    things = unmapped_obstacles(some.grid, some.walls(pose))
    for thing in things:
        assert np.all(distance_to_segments(thing, some.faces).min(axis=1) > APART_M - 0.06)
        assert np.all(distance_to_segments(thing, gone).min(axis=1) < 0.1)
        assert not is_mapped(some.walls(pose), thing[0])
        assert is_mapped(whole.walls(pose), thing[0])
    hit = some.grid.points(np.argwhere(some.grid.evidence > 0))
    alone = distance_to_segments(hit, some.faces).min(axis=1) > APART_M + 0.1
    assert bool(things) or np.count_nonzero(alone) < 3


def test_the_robot_stands_where_it_can_and_not_too_near(scene_of):
    whole = scene_of(1)
    some, _ = without_some(whole, np.random.default_rng(1))
    pose = np.append(whole.places[0], 0.0)
    situation = some.situation(pose, [])
    field = DrivingField(some.grid, pose[:2], situation.following.paths)
    (thing, *_) = unmapped_obstacles(some.grid, some.walls(pose))
    places = obstacle_viewpoints(thing, field)
    assert len(places)
    assert np.all(np.isfinite(field.metres(places)))
    nearest = np.hypot(*np.moveaxis(places[:, None] - thing, -1, 0)).min(axis=1)
    assert np.all((nearest > 0.2 + LOOK_BEYOND_M[0] - 1e-3) & (nearest < 0.2 + LOOK_BEYOND_M[1] + 1e-3))


def test_the_last_layer_goes_to_each_until_it_was_in_vain_and_only_when_it_is_on(scene_of):
    some, _ = without_some(scene_of(1), np.random.default_rng(1))
    pose, visited = np.append(some.places[0], 0.0), []

    def situation():
        return replace(
            some.situation(pose, []), was_in_vain=lambda place: any(np.all(place == each) for each in visited)
        )

    while (choice := nearest_left(situation(), sweep=True)) is not None:
        visited.append(choice.target.centre_world)
        assert len(visited) < 30
    assert visited
    assert nearest_left(some.situation(pose, []), sweep=False) is None
