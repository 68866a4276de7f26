"""The track along and round a wall: position and distance of a place, and back."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.following.track import Track, track_of
from chainslam.slam.geometry.poses import compose

STANDOFF_M = 0.35


def track_at(pose, length_m):
    """A wall from the pose's place along its heading; the free side is on its left."""
    heading = pose[2]
    along = np.array([np.cos(heading), np.sin(heading)])
    return Track(pose[:2], along, np.array([along[1], -along[0]]), length_m, STANDOFF_M)


def random_tracks(seed, count=40):
    rng = np.random.default_rng(seed)
    for _ in range(count):
        yield rng, track_at(rng.uniform([-5, -5, -np.pi], [5, 5, np.pi]), float(rng.uniform(0.1, 6.0)))


def test_a_place_of_the_track_is_located_where_it_is():
    for rng, track in random_tracks(1):
        turn = np.pi * STANDOFF_M
        for _ in range(20):
            position, distance = rng.uniform(-turn, track.length_m + turn), rng.uniform(0.05, 1.0)
            assert track.locate(track.place(position, distance)) == pytest.approx((position, distance), abs=1e-9)


def test_the_distance_is_that_to_the_wall_or_to_its_nearer_end():
    """Brute force: the least distance to points along the wall, on its free side and past its ends."""
    for rng, track in random_tracks(2):
        points = track.tail_world + np.linspace(0.0, track.length_m, 2001)[:, None] * track.along
        for place in track.tail_world + rng.uniform(-4.0, 4.0, (30, 2)):
            offset = place - track.tail_world
            is_behind = offset @ track.into > 0.0 and 0.0 < offset @ track.along < track.length_m
            seen = points if not is_behind else points[[0, -1]]
            assert track.locate(place)[1] == pytest.approx(np.hypot(*(seen - place).T).min(), abs=2e-3)


def test_the_track_turns_with_the_world():
    rng = np.random.default_rng(3)
    for _ in range(20):
        pose, by = rng.uniform(-3, 3, 3), rng.uniform(-3, 3, 3)
        place = rng.uniform(-3, 3, 2)
        moved = track_at(compose(by, pose), 2.0)
        found = moved.locate(compose(by, np.append(place, 0.0))[:2])
        np.testing.assert_allclose(found, track_at(pose, 2.0).locate(place), atol=1e-9)


def test_the_track_of_a_wall_of_the_map_runs_from_tail_to_head_on_the_free_side(scene_with):
    faces = np.array([[[0.0, 0.0], [2.0, 0.0]]])  # free side on the left: above it
    track = track_of(0, scene_with(faces), STANDOFF_M)
    assert track.length_m == pytest.approx(2.0)
    assert track.place(1.0, STANDOFF_M) == pytest.approx([1.0, STANDOFF_M])
    quarter = 0.5 * np.pi * STANDOFF_M
    assert track.place(2.0 + quarter, STANDOFF_M) == pytest.approx([2.0 + STANDOFF_M, 0.0])
    assert track.place(-2.0 * quarter, STANDOFF_M) == pytest.approx([0.0, -STANDOFF_M])
    assert track.is_past_end(2.1)
    assert track.is_past_end(-0.1)
    assert not track.is_past_end(1.0)
    assert replace(track, standoff_m=0.5).place(1.0, 0.5) == pytest.approx([1.0, 0.5])
