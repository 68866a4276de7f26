"""Two walls that reach past the place where their lines cross end there; nothing else does."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.association.matching import MatchingConfig
from chainslam.slam.backends import BACKENDS
from chainslam.slam.config import MapperConfig
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.estimation.shared import SharedConfig
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.map.bends import ends_at_bends
from chainslam.slam.map.extents import WallsConfig
from chainslam.slam.map.landmarks import Landmarks
from chainslam.slam.map.merging import MergingConfig
from chainslam.slam.map_keeper import MapKeeper
from tests.slam.map.maps import map_of

ONE_WALL, RANGE_M = MatchingConfig().one_wall, 4.0


def bent(degrees, before_m=0.4, after_m=0.3, towards=0.0, at=(0.0, 0.0), long_m=2.4):
    """Return two faces, the first walked before the bend `at`: each reaches past it, and is `long_m` up to it."""
    first, second = directions(np.array([towards, towards + np.deg2rad(degrees)]))
    ends = [[-long_m * first, before_m * first], [-after_m * second, long_m * second]]
    return np.array(ends) + at


def known(faces, pose=(0.0, -1.0, 0.0), sigma=(0.002, 0.003)):
    """Return a map of faces in which each line is known to (rad, m)."""
    walls = map_of(faces, np.array(pose))

    def query(ids):
        rows = np.searchsorted(walls.ids, ids)
        cov = np.diag(np.concatenate([np.full(3, 1e-4), np.tile(np.square(sigma), len(rows))]))
        return Joint(np.r_[pose, walls.belief.means[rows].ravel()], cov, walls.belief.anchors[rows])

    return replace(walls, belief=replace(walls.belief, query=query))


def met(walls, shared=SharedConfig(), range_m=RANGE_M):
    """Return the pairs that meet, and where that is on each wall, world frame."""
    pairs, along = ends_at_bends(walls, range_m, ONE_WALL, shared)
    rows = walls.belief.rows(pairs.ravel())
    means, anchors = walls.belief.means[rows], walls.belief.anchors[rows]
    places = anchors + means[:, 1:] * normals(means[:, 0]) + along.reshape(-1, 1) * directions(means[:, 0])
    return pairs.tolist(), places.reshape(-1, 2, 2)


@pytest.mark.parametrize("degrees", [-25.0, -6.0, -2.0, 2.0, 6.0, 25.0])
@pytest.mark.parametrize("towards", [0.3, 2.9, -1.7])
@pytest.mark.parametrize("turned_round", [False, True])
def test_both_walls_end_where_their_lines_cross(degrees, towards, turned_round):
    faces = bent(degrees, 0.06, 1.3, towards, (3.0, -2.0))
    pairs, places = met(known(faces[::-1] if turned_round else faces, (3.0, -2.5, 0.0)))
    assert pairs == [[1, 0] if turned_round else [0, 1]]
    assert places == pytest.approx(np.broadcast_to([3.0, -2.0], (1, 2, 2)), abs=1e-9)


NONE = {
    "they overlap by less than ends are uncertain": bent(6.0, 0.02, 0.02),
    "the second begins well after the crossing": bent(6.0, 0.4, -0.06),
    "the first ends well before the crossing": bent(6.0, -0.06, 0.4),
    "the second overlaps the whole of the first": bent(6.0, 0.1, 0.35, long_m=0.2),
    "the second ends beside the first": np.array([bent(6.0)[0], [[-0.3, 0.0], [0.3, 0.01]]]),
    "they meet in a corner": bent(40.0, 0.05, 0.05),
    "they may be one line": bent(0.4, 0.3, 0.3),
    "they are parallel": np.array([[[-2.0, 0.0], [0.3, 0.0]], [[-0.3, 0.03], [2.0, 0.03]]]),
}


@pytest.mark.parametrize("case", NONE)
def test_walls_that_do_not_both_reach_past_one_bend_stay_as_they_are(case):
    assert met(known(NONE[case]))[0] == []


@pytest.mark.parametrize("which", [0, 1])
def test_walls_that_are_far_or_seldom_seen_or_tentative_stay_as_they_are(which):
    walls = known(bent(6.0))
    assert met(walls)[0] == [[0, 1]]
    assert met(walls, range_m=0.4)[0] == []
    seldom = np.where(np.arange(2) == which, 9, 20)
    assert met(replace(walls, observations=seldom))[0] == []
    assert met(replace(walls, tentative=np.arange(2) == which))[0] == []


def ended(walls, pairs, along):
    """Return from where to where walls reach once each pair has met."""
    landmarks = Landmarks(WallsConfig(), ExtractionConfig().sure_beams)
    landmarks.records.rows(walls.ids)
    landmarks.records.columns["extents"][:] = walls.extents
    landmarks.extents.meet(np.array(pairs), np.array(along))
    return landmarks.records.columns["extents"]


def test_a_wall_ends_at_the_nearest_of_its_bends_and_is_never_lengthened():
    walls = map_of(np.array([[[-1.0, 0.0], [1.0, 0.0]]] * 4), np.zeros(3))
    extents = ended(walls, [[0, 1], [0, 2], [3, 0], [2, 3]], [[0.5, -0.2], [0.3, -2.0], [0.7, -0.4], [3.0, 0.2]])
    np.testing.assert_allclose(extents, [[-0.4, 0.3], [-0.2, 1.0], [-1.0, 1.0], [0.2, 0.7]])


@pytest.mark.parametrize(("left_m", "is_left"), [(-0.03, False), (0.04, False), (0.06, True)])
def test_a_wall_of_which_nothing_would_be_left_stays_as_it_is(left_m, is_left):
    """Two bends at its ends, or one that lies before it begins: its other side ends there all the same."""
    walls = map_of(np.array([[[-1.0, 0.0], [1.0, 0.0]]] * 3), np.zeros(3))
    extents = ended(walls, [[0, 1], [2, 0]], [[0.1, -0.6], [0.5, 0.1 - left_m]])
    np.testing.assert_allclose(extents, [[0.1 - left_m, 0.1] if is_left else [-1.0, 1.0], [-0.6, 1.0], [-1.0, 0.5]])


def test_walls_that_never_merge_never_end_at_bends(monkeypatch):
    """As in the paper, which knows neither."""
    walls = known(bent(6.0))
    for merging, ends_at_m in ((MergingConfig(), 0.0), (None, -0.3)):
        keeper = MapKeeper(BACKENDS["full-ekf"].make(np.zeros(3), np.eye(3)), MapperConfig(merging=merging))
        keeper.landmarks.records.rows(walls.ids)
        extents = keeper.landmarks.records.columns["extents"]
        extents[:] = walls.extents
        monkeypatch.setattr(keeper, "map", lambda extents=extents: replace(walls, extents=extents.copy()))
        found = keeper._ended_at_bends(RANGE_M)
        np.testing.assert_allclose(found.extents[1, 0] - walls.extents[1, 0], 0.3 + ends_at_m, atol=1e-9)


def crossing_of(first, second, shared):
    """Return where two faces that meet at a bend cross, or None: by solving for it."""
    (a, b), (c, d) = first, second
    t, u = (b - a) / np.linalg.norm(b - a), (d - c) / np.linalg.norm(d - c)
    turn = np.arctan2(t[0] * u[1] - t[1] * u[0], t @ u)
    overlap = (b - c) @ t
    if not shared.resolution_m < overlap < np.linalg.norm(b - a):
        return None
    if not 0 < abs(turn) < shared.sharp_rad or (d - b) @ t <= 0:
        return None
    ahead, _ = np.linalg.solve(np.column_stack([t, -u]), c - a)
    ends = (c - a) @ t - shared.resolution_m, np.linalg.norm(b - a) + shared.resolution_m
    return a + ahead * t if ends[0] < ahead < ends[1] else None


@settings(max_examples=100, deadline=None)
@given(st.integers(0, 2**32 - 1))
def test_in_random_maps_just_those_pairs_meet_that_a_direct_solution_finds(seed):
    """All that look along one way, which a dozen walls about two bends do; nobody knows two for one."""
    rng, shared = np.random.default_rng(seed), SharedConfig(sharp_rad=0.4)
    along, turns = rng.uniform(-1.0, 1.0, (12, 1)), rng.uniform(-0.3, 0.3, 12)
    middles = along * directions(np.array(0.0)) + rng.normal(scale=0.04, size=(12, 2))
    half = rng.uniform(0.1, 1.2, (12, 1)) * directions(turns)
    faces = np.stack([middles - half, middles + half], axis=1)
    pairs, places = met(known(faces, sigma=(1e-6, 1e-6)), shared, range_m=20.0)
    expected = {(i, j): crossing_of(faces[i], faces[j], shared) for i in range(12) for j in range(12) if i != j}
    expected = {pair: point for pair, point in expected.items() if point is not None}
    assert set(map(tuple, pairs)) == set(expected)
    for pair, both in zip(pairs, places, strict=True):
        assert both == pytest.approx(np.broadcast_to(expected[tuple(pair)], (2, 2)), abs=1e-6)
