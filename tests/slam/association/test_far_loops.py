"""Loops of any length: sought where the covariance of the path says, and closed with more evidence than others."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from chainslam.slam.association.place_search import Place, Window
from chainslam.slam.association.second_looks import loop_search
from chainslam.slam.association.second_looks.closures import settled
from chainslam.slam.association.second_looks.loop_search import Candidate, LoopSearch
from chainslam.slam.association.second_looks.submaps import Returns
from chainslam.slam.geometry.poses import compose, inverse, wrap
from tests.slam.association.drives import STATED, along, driven, followed, motions_of, off_m, returns_at
from tests.slam.association.test_where_places_are_sought import CONFIG, PLACES, THERE_AND_BACK, StandIn, put, search

pytestmark = pytest.mark.usefixtures("_unchecked")
"""Returns and places are stood in for."""


def far(**changes):
    """The same way, of which all that is searched counts as far."""
    return search(config=replace(CONFIG, closures=replace(PLACES, far_m=0.5, **changes)))


def test_after_a_long_way_a_place_is_sought_as_far_around_as_the_covariance_of_the_path_says():
    (candidate,) = far()._candidates(70)
    assert candidate.old == 11
    sigma_m = np.sqrt(np.linalg.eigvalsh(candidate.drift[:2, :2])[-1])
    assert candidate.window.half_m == pytest.approx(PLACES.radius_m + PLACES.far_sigmas * sigma_m)
    turn = PLACES.turn_rad + PLACES.far_sigmas * np.sqrt(candidate.drift[2, 2])
    assert candidate.window.half_rad == pytest.approx(turn)
    assert all(each.drift is None for each in search()._candidates(70))


def test_the_covariance_of_the_way_is_that_of_its_noise():
    looked, rng = far(), np.random.default_rng(4)
    old, drift = next((each.old, each.drift) for each in looked._candidates(70))
    noise = rng.normal(0.0, STATED / np.sqrt(CONFIG.understated), (2000, 80, 3))
    off = []
    for each in noise:
        poses = followed(np.zeros(3), np.concatenate([THERE_AND_BACK[:80] + each]))
        put = compose(looked.poses[old], compose(inverse(poses[old]), poses[70]))
        off.append([*(put - looked.poses[70])[:2], wrap(put[2] - looked.poses[70, 2])])
    found = np.cov(np.array(off).T)
    np.testing.assert_allclose(np.sqrt(np.diag(drift)), np.sqrt(np.diag(found)), rtol=0.06)
    assert drift[1, 2] / np.sqrt(drift[1, 1] * drift[2, 2]) == pytest.approx(
        found[1, 2] / np.sqrt(found[1, 1] * found[2, 2]), abs=0.06
    )


def test_a_closure_makes_the_covariance_of_all_ways_over_it_small():
    looked = far()
    _, nexts = looked._shortest_ways(70)
    alone = looked._drift(70, nexts)[11]
    looked.closures.append(put(12, 69))
    closed = looked._drift(70, looked._shortest_ways(70)[1])[11]
    assert np.trace(closed) < 0.2 * np.trace(alone)
    assert closed[0, 0] >= PLACES.sigma_m**2


def test_what_is_far_is_sought_once_a_metre_and_never_over_a_slip():
    looked = far()
    assert looked._candidates(70) != []
    assert looked._candidates(71) == []
    assert looked._candidates(72) != []
    slipped = search(returns=StandIn(slips=[66]), config=replace(CONFIG, closures=replace(PLACES, far_m=0.5)))
    assert slipped._candidates(70) == []


@pytest.mark.parametrize(("is_far", "needed"), [(False, 2), (True, 3)])
def test_what_is_far_needs_a_third_that_agrees(is_far, needed, monkeypatch):
    looked = search()
    looked._found.clear()
    drift = np.eye(3) if is_far else None
    monkeypatch.setattr(looked, "_is_alone", lambda *_: True)
    for count, new in enumerate((64, 66, 68, 70), 1):
        given = put(81 - new, new), Candidate(81 - new, Window(np.zeros(3), 1.0, 0.1), drift)
        monkeypatch.setattr(looked, "_place", lambda _, given=given: given)
        looked._look(new)
        assert len(looked.closures) == (count if count >= needed else 0)


def test_a_closure_that_would_move_the_path_is_refused_where_it_has_a_rival(monkeypatch):
    looked = search()
    monkeypatch.setattr(looked, "_is_alone", lambda *_: False)
    for off, count in (((0.0, 1.0, 0.0), 0), ((0.0, 0.0, 0.0), 2)):
        for new in (66, 69):
            given = put(81 - new, new, off), Candidate(81 - new, Window(np.zeros(3), 1.0, 0.1))
            monkeypatch.setattr(looked, "_place", lambda _, given=given: given)
            looked._look(new)
        assert len(looked.closures) == count


@pytest.mark.parametrize(("off", "is_found"), [((0.6, 0.0, 0.0), True), ((9.0, 0.0, 0.0), False), ((0, 0, 1.5), False)])
def test_a_place_that_the_graph_does_not_allow_is_refused(off, is_found, monkeypatch):
    looked = far()
    looked._returns = StandIn(200)
    pose = looked.poses[70] + off
    monkeypatch.setattr(loop_search, "place_on", lambda *_: Place(pose, 0.9, 0.0))
    found = looked._place(70)
    assert (found is not None) is is_found
    if found is not None:
        closure, _ = found
        assert closure.old == int(np.argmin(np.hypot(*(looked.poses[:50] - pose)[:, :2].T)))
        np.testing.assert_allclose(compose(looked.poses[closure.old], closure.motion), pose, atol=1e-9)


@pytest.mark.parametrize(("x", "rival", "is_alone"), [(0.0, 0.0, True), (0.0, 0.85, False), (3.0, 0.0, False)])
def test_a_closure_has_no_rival_twice_as_far_around(x, rival, is_alone, monkeypatch):
    looked, asked = search(), []
    (candidate,) = looked._candidates(70)
    looked._returns = StandIn(200)
    put_at = looked.poses[70] + [x, 0.0, 0.0]

    def place_on(surface, points, window, config):
        asked.append(window)
        return Place(put_at, 0.9, rival)

    monkeypatch.setattr(loop_search, "place_on", place_on)
    assert looked._is_alone(put(11, 70), candidate) is is_alone
    assert asked[0].half_m == 2.0 * candidate.window.half_m


def a_long_ring(seed, alike):
    """A corridor of 180 to 240 m around a block, with niches at random, or on all four sides the same; and its way."""
    rng = np.random.default_rng([11, seed])
    length, deep = rng.uniform(47.0, 62.0), rng.uniform(0.4, 1.0)
    niches = []
    for side in [0, 1, 2, 3] * 8:
        at = (len(niches) // 4 + 0.5) / 8 if alike else rng.uniform(0.05, 0.95)
        reach, half = (deep, 0.5) if alike else (rng.uniform(0.3, 1.0), rng.uniform(0.25, 0.75))
        niche = shapely.box(at * length - half, -reach, at * length + half, 0.0)
        niches.append(shapely.affinity.rotate(niche, 90 * side, (length / 2, length / 2)))
    ring = shapely.box(0, 0, length, length).difference(shapely.box(2, 2, length - 2, length - 2))
    far = length - 1.0
    return shapely.union_all([ring, *niches]), shapely.LinearRing([(1, 1), (far, 1), (far, far), (1, far)])


@pytest.mark.parametrize("alike", [False, True])
@pytest.mark.parametrize("seed", range(3))
def test_a_long_ring_is_closed_where_it_closes_although_its_sides_are_alike(seed, alike):
    building, way = a_long_ring(seed, alike)
    true, rng = along(way, 0.8, 1.25 * way.length), np.random.default_rng([10, seed])
    motions = motions_of(true)
    motions += rng.normal(0.0, STATED / np.sqrt(CONFIG.understated), motions.shape)
    returns = Returns(returns_at(true, seed, building=building), PLACES)
    looked = LoopSearch(true[0], driven(motions), returns, CONFIG)
    assert len(looked.closures) >= 3
    for each in looked.closures:
        off = each.motion - compose(inverse(true[each.old]), true[each.new])
        assert np.hypot(*off[:2]) < 0.2
        assert abs(wrap(off[2])) < 0.05
    first = int(way.length / 0.8)
    poses = settled(looked.poses, looked.drive, looked.closures, CONFIG)
    again = np.array([compose(inverse(poses[k]), poses[first + k]) for k in range(10, 40)])
    should = np.array([compose(inverse(true[k]), true[first + k]) for k in range(10, 40)])
    assert off_m(again, should).max() < 0.3
    assert off_m(followed(true[0], motions), true).max() > 1.0
