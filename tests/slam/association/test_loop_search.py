"""Loops of simulated drives with drift are closed, aliases are refused, and a wrong closure is taken back."""

from dataclasses import replace
from functools import cache

import numpy as np
import pytest
import shapely

from chainslam.slam.association.kernels.correlation_kernels import best_in_blocks, largest_ahead, mean_at
from chainslam.slam.association.place_search import Window, place_on
from chainslam.slam.association.second_looks.closures import Closure, held, settled
from chainslam.slam.association.second_looks.config import SecondLooksConfig
from chainslam.slam.association.second_looks.loop_search import LoopSearch
from chainslam.slam.association.second_looks.submaps import Returns
from chainslam.slam.geometry.poses import compose, inverse, to_robot, to_world, wrap
from tests.slam.association.drives import drifting, driven, followed, motions_of, off_m, returns_at, round_the_ring

CONFIG = SecondLooksConfig()
PLACES = CONFIG.closures


@cache
def ring():
    """A drive of 1.4 laps and its search; no fixture, so that a test without a rule searches without it."""
    true = round_the_ring()
    motions = drifting(true)
    return true, motions, LoopSearch(true[0], driven(motions), Returns(returns_at(true), PLACES), CONFIG)


def test_a_loop_is_closed_although_the_path_came_apart_by_far_more_than_any_gate():
    true, motions, search = ring()
    assert off_m(followed(true[0], motions), true).max() > 1.5
    assert len(search.closures) >= 4
    for each in search.closures:
        off = each.motion - compose(inverse(true[each.old]), true[each.new])
        assert np.hypot(*off[:2]) < 0.06
        assert abs(wrap(off[2])) < 0.03
    assert search.drive.slipped == []
    found = settled(search.poses, search.drive, search.closures, CONFIG)
    end_to_start = compose(inverse(found[0]), found[88]) - compose(inverse(true[0]), true[88])
    assert np.hypot(*end_to_start[:2]) < 0.1


def test_a_turn_that_nobody_reported_is_found():
    true = round_the_ring(laps=1.5)
    motions = drifting(true, 0.0)
    corner = int(np.argmax(np.abs(motions[:, 2]))) + 1
    motions[corner - 1, 2] -= 1.0
    search = LoopSearch(true[0], driven(motions), Returns(returns_at(true), PLACES), CONFIG)
    assert search.drive.slipped == [corner]
    assert off_m(settled(search.poses, search.drive, search.closures, CONFIG), true).max() < 0.15


def test_one_finding_alone_closes_nothing():
    true, motions, _ = ring()
    alone = replace(CONFIG, closures=replace(PLACES, every_m=5.0))
    once = LoopSearch(true[0], driven(motions), Returns(returns_at(true), PLACES), alone)
    assert once._found
    assert once.closures == []


def room(x):
    """A room without its right wall, as points 5 cm apart, with a niche that tells its walls apart."""
    ring = shapely.LineString([(x, 0), (x, 2), (x + 0.5, 2), (x + 0.5, 2.4), (x + 1.4, 2.4), (x + 1.4, 0), (x, 0)])
    return shapely.get_coordinates([ring.interpolate(s) for s in np.arange(0.0, ring.length, 0.05)])


@pytest.mark.parametrize("rooms", [[0.0], [0.0, 2.6]])
def test_of_two_equal_rooms_each_is_the_others_rival(rooms):
    pose = np.array([0.7, 1.0, 0.4])
    window = Window(pose + np.array([0.4, -0.3, 0.1]), 3.2, 0.3)
    surface = np.concatenate([room(x) for x in rooms])
    place = place_on(surface, to_robot(room(0.0), pose), window, PLACES.place)
    assert place.score > 0.9
    if len(rooms) == 1:
        assert place.rival < PLACES.place.rival * place.score
        np.testing.assert_allclose(place.pose, pose, atol=0.02)
    else:
        assert place.rival > PLACES.place.rival * place.score


def test_equal_rooms_close_no_loop():
    """The robot stands in one room, goes 8 m blind, and stands in a room that is the same, beside the first."""
    true = np.concatenate([np.column_stack([0.5 + 0.02 * np.arange(8), np.full(8, 1.0), np.zeros(8)])])
    away = np.column_stack([np.full(24, 0.6), 1.0 - np.abs(np.arange(24) - 12.0) + 12.0, np.zeros(24)])
    back = np.column_stack([0.2 + 0.3 * np.arange(4), np.full(4, 1.0), np.zeros(4)])
    poses = np.concatenate([true, away, back, back])
    motions = motions_of(poses)
    nothing, both = np.zeros((0, 2)), np.concatenate([room(0.0), room(1.6)])
    points = [to_robot(both if k < 8 else nothing if k < 32 else room(0.0), poses[k]) for k in range(len(poses))]
    small = replace(PLACES, least_points=50)
    search = LoopSearch(poses[0], driven(motions), Returns(points, small), replace(CONFIG, closures=small))
    assert search.closures == []
    one = [to_robot(room(0.0), poses[k]) if k < 8 else each for k, each in enumerate(points)]
    assert LoopSearch(poses[0], driven(motions), Returns(one, small), replace(CONFIG, closures=small))._found


def test_a_wrong_closure_is_taken_back_where_others_contradict_it():
    true, motions, search = ring()
    wrong = Closure(20, 100, np.array([0.1, 0.2, 0.3]))
    closures = [wrong, *search.closures]
    misled = settled(followed(true[0], motions), driven(motions), [wrong], CONFIG)
    assert held([wrong], misled, PLACES) == [wrong]
    found = settled(misled, driven(motions), closures, CONFIG)
    assert held(closures, found, PLACES) == search.closures
    right = settled(search.poses, search.drive, search.closures, CONFIG)
    assert off_m(found, right).max() < 0.05


def test_the_search_by_blocks_finds_what_trying_all_finds():
    rng = np.random.default_rng(7)
    values = np.zeros((60, 60), dtype=np.float32)
    values[rng.integers(15, 45, 150), rng.integers(15, 45, 150)] = rng.random(150, dtype=np.float32)
    rows, columns = (rng.integers(20, 40, (3, 25)).astype(np.int32) for _ in range(2))
    size, reach, least, share = 8, 11, 0.01, 0.9
    bounds = largest_ahead(values, size)
    for y, x in rng.integers(0, 60, (50, 2)):
        assert bounds[y, x] == values[y : y + size, x : x + size].max()
    found = best_in_blocks(values, bounds, rows, columns, reach, size, least, share)
    every = [
        (mean_at(values, rows[a], columns[a], dy, dx), a, dy, dx)
        for a in range(3)
        for dy in range(-reach, reach + 1)
        for dx in range(-reach, reach + 1)
    ]
    np.testing.assert_allclose(found[np.argmax(found[:, 0])][0], max(every)[0])
    for value, a, dy, dx in every:
        if value >= share * max(every)[0]:
            block = ((dy + reach) // size, (dx + reach) // size)
            rivals = found[(found[:, 1] == a)]
            of = [tuple(pair) for pair in ((rivals[:, 2:] + reach) // size).astype(int)]
            assert rivals[of.index(block), 0] >= value - 1e-9


def test_a_scan_fits_those_before_it_as_far_as_it_saw_the_same():
    true = round_the_ring(laps=0.1)[:4]
    points = returns_at(true)
    returns = Returns([*points, to_world(points[0], np.array([30.0, 0.0, 0.0]))], PLACES)
    poses = np.concatenate([true, true[:1]])
    assert returns.fit(2, range(2), poses) > 0.9
    assert returns.fit(4, range(2), poses) == 0.0
    assert returns.fit(2, range(0), poses) == 1.0
