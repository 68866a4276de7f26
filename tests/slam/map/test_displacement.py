"""Where the ends of walls go when a correction moves the map, against motions that are known."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.backends import BACKENDS
from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.estimation.backend import Belief
from chainslam.slam.geometry.lines import directions, normals, through
from chainslam.slam.geometry.poses import rotation
from chainslam.slam.map.chains import connect
from chainslam.slam.map.displacement import along
from chainslam.slam.map.extents import WallsConfig
from chainslam.slam.map.kernels.wall_kernels import across
from chainslam.slam.map.landmarks import Landmarks
from tests.slam.test_mapper import AT_ITS_WORD, faces_of, walk

NEAR_M = 1.0
SQUARE = np.array([[0.0, 0.0], [5.0, 0.0], [5.0, 4.0], [0.0, 4.0]])
ROOM = np.stack([SQUARE, np.roll(SQUARE, -1, axis=0)], axis=1)
"""Its four walls, free side on the left."""
PILASTER = np.array([[[2.0, 1.0], [2.6, 1.0]]])


def moved(points, shift, turn):
    return points @ rotation(turn).T + shift


def by(shift, points):
    return moved(points, shift, 0.0)


def means_of(faces, anchors):
    lines = through(faces)
    return np.column_stack([lines[:, 0], lines[:, 1] - np.vecdot(normals(lines[:, 0]), anchors)])


def shifts(faces, after, tell=slice(None)):
    """What `along` says of walls whose lines went from those of these faces to those of others."""
    anchors = faces.mean(axis=1)
    before, now = means_of(faces, anchors), means_of(after, anchors)
    told = faces[tell], before[tell, 0], across(faces[tell], anchors[tell], now[tell])
    return along(faces.mean(axis=1), before[:, 0], *told, NEAR_M)


@settings(max_examples=30, deadline=None)
@given(st.integers(0, 10**6), st.floats(-1.0, 1.0), st.floats(-1.0, 1.0), st.floats(-1e-3, 1e-3))
def test_where_everything_moves_as_one_walls_go_along_themselves_as_all_does(seed, x, y, turn):
    rng = np.random.default_rng(seed)
    starts = 10.0 * rng.normal(size=(8, 1, 2))
    faces = np.concatenate([starts, starts + rng.normal(size=(8, 1, 2))], axis=1)
    faces = np.concatenate([faces, ROOM])
    after = moved(faces, np.array([x, y]), turn)
    t = directions(through(faces)[:, 0])
    exact = np.vecdot(t, (after - faces).mean(axis=1))
    np.testing.assert_allclose(shifts(faces, after), exact, atol=2e-3)  # a metre times the turn


def test_how_far_a_line_moved_is_measured_at_both_ends_of_its_wall():
    after = moved(ROOM, np.array([0.3, -0.1]), 0.02)
    anchors = ROOM[:, 0] + [7.0, -3.0]
    found = across(ROOM, anchors, means_of(after, anchors))
    for wall, (start, end) in enumerate(after):
        along_it = (end - start) / np.hypot(*(end - start))
        n = np.array([along_it[1], -along_it[0]])  # towards the wall, from its free side
        turn = n @ normals(through(ROOM)[wall : wall + 1, 0])[0]
        for side in range(2):
            assert found[wall, side] == pytest.approx((start - ROOM[wall, side]) @ n, abs=1e-12)
        assert turn > 0.99


@pytest.mark.parametrize("seed", range(5))
def test_the_motion_about_a_wall_is_that_of_a_dense_weighted_least_squares(seed):
    rng = np.random.default_rng(seed)
    faces = 5.0 * rng.normal(size=(6, 2, 2))
    told_m, alpha = rng.normal(size=(6, 2)), through(faces)[:, 0]
    found = along(faces.mean(axis=1), alpha, faces, alpha, told_m, NEAR_M)
    for wall in range(6):
        middle, rows, values = faces[wall].mean(axis=0), [], []
        for other in range(6):
            n = normals(alpha[other : other + 1])[0]
            for side in range(2):
                arm = faces[other, side] - middle
                root = 1.0 / np.sqrt(1.0 + arm @ arm / NEAR_M**2)
                rows.append(root * np.array([n[0], n[1], n @ [-arm[1], arm[0]]]))
                values.append(root * told_m[other, side])
        motion = np.linalg.lstsq(np.array(rows), np.array(values), rcond=None)[0]
        assert found[wall] == pytest.approx(motion[:2] @ directions(alpha[wall : wall + 1])[0], abs=1e-9)


def test_what_no_wall_tells_is_taken_for_none():
    """A corridor without a cross wall moves obliquely: only what is across it shows."""
    corridor = moved(ROOM[[0, 2]], np.zeros(2), 0.3)  # not along an axis: its walls are parallel but for rounding
    np.testing.assert_allclose(shifts(corridor, by([0.5, 0.2], corridor)), 0.0, atol=1e-9)


def test_two_rooms_that_come_apart_go_each_its_way():
    far = by([40.0, 0.0], ROOM)
    faces, after = np.concatenate([ROOM, far]), np.concatenate([by([0.3, 0.2], ROOM), by([-0.3, -0.2], far)])
    exact = np.vecdot(directions(through(faces)[:, 0]), (after - faces).mean(axis=1))
    np.testing.assert_allclose(shifts(faces, after), exact, atol=0.04)


def landmarks_of(faces):
    """Walls whose ends were seen where the faces end, and how the map is told once they lie elsewhere."""
    known = Landmarks(WallsConfig(), 5)
    anchors = faces.mean(axis=1)
    half = 0.5 * np.hypot(*(faces[:, 1] - faces[:, 0]).T)
    rows = known.records.rows(np.arange(len(faces)))
    known.records.columns["extents"][rows] = np.column_stack([-half, half])
    known.records.columns["observations"][rows] = 20
    known.records.columns["log_odds"][rows] = 10.0

    def belief(at):
        return Belief(np.zeros(3), np.eye(3), np.arange(len(faces)), anchors, means_of(at, anchors), lambda ids: None)

    known.extents.follow(belief(faces))
    return known, belief


def follow(known, belief):
    known.extents.follow(belief)
    return known.map(belief)


def test_a_room_that_is_moved_stays_one_closed_chain():
    known, belief = landmarks_of(ROOM)
    after = moved(ROOM, np.array([0.4, -0.3]), 0.03)
    (torn,) = {chain.is_closed for chain in connect(known.map(belief(after)))}
    assert not torn
    walls = follow(known, belief(after))
    np.testing.assert_allclose(walls.ends_world, after, atol=2e-3)
    (chain,) = connect(walls)
    assert chain.is_closed


def test_ends_follow_step_by_step_what_they_are_known_to():
    known, belief = landmarks_of(ROOM)
    extents = known.records.columns["extents"].copy()
    follow(known, belief(by([0.03, 0.03], ROOM)))
    np.testing.assert_array_equal(known.records.columns["extents"], extents)
    walls = follow(known, belief(by([0.06, 0.03], ROOM)))  # since the ends were placed, not since the last step
    np.testing.assert_allclose(walls.ends_world, by([0.06, 0.03], ROOM), atol=1e-6)


def test_a_short_wall_that_moves_by_itself_carries_no_other_along():
    faces = np.concatenate([ROOM, PILASTER])
    known, belief = landmarks_of(faces)
    extents = known.records.columns["extents"].copy()
    follow(known, belief(np.concatenate([ROOM, by([0.0, 0.2], PILASTER)])))
    np.testing.assert_array_equal(known.records.columns["extents"], extents)


def test_a_short_wall_follows_the_long_ones():
    faces = np.concatenate([ROOM, PILASTER])
    known, belief = landmarks_of(faces)
    after = by([0.5, 0.0], np.concatenate([ROOM, by([0.0, 0.2], PILASTER)]))
    np.testing.assert_allclose(follow(known, belief(after)).ends_world, after, atol=1e-6)


def test_a_wall_that_is_not_seen_yet_has_no_ends_to_move():
    known, belief = landmarks_of(ROOM)
    known.records.columns["extents"][2] = [np.inf, -np.inf]
    follow(known, belief(by([0.4, 0.0], ROOM)))
    np.testing.assert_array_equal(known.records.columns["extents"][2], [np.inf, -np.inf])


class Corrected(FullEkf):
    """Moves pose and map at its last update, as where a loop is closed."""

    shift_m = np.array([0.3, -0.2])
    updates = 0

    def update(self, first, second):
        super().update(first, second)
        self.updates += 1
        if self.updates == len(ROUND):
            state, slots = self.map._x, self.map._slots
            state[:2] += self.shift_m
            state[4 + 2 * slots] += normals(state[3 + 2 * slots]) @ self.shift_m
            self._move_on()


ROUND = [[1.5, 1.5, 0.0], [3.0, 1.5, 0.0], [4.5, 1.5, 0.8], [5.5, 2.5, 1.6], [5.5, 4.0, 1.6], [5.5, 5.5, 2.4]]
ROUND += [[4.0, 5.5, 3.1], [2.5, 5.5, -2.4], [1.5, 4.5, -1.6], [1.5, 3.0, -1.6], [1.5, 1.5, -1.6], [1.5, 1.4, -1.6]]


def test_corners_out_of_sight_stay_corners_where_a_correction_moves_the_map(monkeypatch):
    """The last scan shows one corner of a hall of 7 m; the others are where the walls' ends say."""
    monkeypatch.setitem(BACKENDS, "corrected", replace(BACKENDS["full-ekf"], kind=Corrected))
    *_, before, last = walk(faces_of(shapely.box(0, 0, 7, 7)), ROUND, "corrected", config=AT_ITS_WORD)
    assert [chain.is_closed for chain in before.chains] == [chain.is_closed for chain in last.chains] == [True]
    moved = last.map.belief.pose_world[:2] - ROUND[-1][:2]
    np.testing.assert_allclose(moved, Corrected.shift_m, atol=0.01)
    far = np.abs(last.map.ends_world - 7.0 - moved).max(axis=-1) < 0.05
    assert np.count_nonzero(far) == 2  # two walls end in the corner that nobody saw at last


def test_the_ends_of_each_room_follow_the_walls_within_some_metres():
    known, belief = landmarks_of(np.concatenate([ROOM, by([40.0, 0.0], ROOM)]))
    after = np.concatenate([by([0.3, 0.2], ROOM), by([39.7, -0.2], ROOM)])
    np.testing.assert_allclose(follow(known, belief(after)).ends_world, after, atol=0.05)


def test_ends_that_followed_are_where_they_are_told_and_go_no_farther():
    known, belief = landmarks_of(ROOM)
    there = belief(by([0.4, -0.3], ROOM))
    once = follow(known, there).ends_world
    np.testing.assert_array_equal(follow(known, there).ends_world, once)
