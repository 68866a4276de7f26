"""Which faces of a drawing are one wall."""

import numpy as np
import pytest

from chainslam.experiments.scoring import truth
from chainslam.experiments.scoring.truth import collinear, truth_of
from chainslam.sim.robot import RobotConfig


def same(*faces):
    return len(set(collinear(np.array(faces)).tolist())) == 1


FACE = [[0.0, 0.0], [1.0, 0.0]]


@pytest.mark.parametrize("far", [0.0, 1e4])
@pytest.mark.parametrize(("off_m", "one"), [(0.0049, True), (0.0051, False)])
@pytest.mark.parametrize("side", [-1, 1])
def test_faces_are_one_wall_up_to_half_a_sigma_apart(far, off_m, one, side):
    other = [[3.0, side * off_m], [4.0, side * off_m]]
    assert same(*(np.array([FACE, other]) + far)) == one


@pytest.mark.parametrize(("turn_deg", "one"), [(0.9, True), (1.1, False), (180.0, False), (179.9, False)])
def test_faces_are_one_wall_up_to_a_degree_and_on_one_side(turn_deg, one):
    """Short ones, so that their ends stay near to each other's line."""
    turn, half = np.deg2rad(turn_deg), 0.02
    along = half * np.array([np.cos(turn), np.sin(turn)])
    near = np.array([[-half, 0.0], [half, 0.0]])
    assert same(near, np.array([-along, along]) + np.array([0.1, 0.0])) == one


def test_both_ends_of_both_faces_count():
    long, short = [[0.0, 0.0], [9.0, 0.0]], [[9.1, 0.0], [9.2, 0.001]]
    assert not same(long, short), "far on, the short one's line leaves the long one"
    assert not same(short, long)
    assert same([[9.0, 0.0], [9.1, 0.0]], short)


def test_a_row_of_faces_is_one_wall_though_its_ends_are_far_apart():
    heights = [0.0, 0.004, 0.008, 0.012]
    row = np.array([[[k, h], [k + 0.9, h]] for k, h in enumerate(heights)])
    assert len(set(collinear(row).tolist())) == 1
    assert len(set(collinear(row[[0, 2]]).tolist())) == 2
    across = np.array([[[k, -1.0], [k, 1.0]] for k in range(3)])
    assert len(set(collinear(np.concatenate([row, across])).tolist())) == 4
    assert collinear(row[:1]).tolist() == [0]


def test_in_a_great_hall_a_degree_is_still_a_degree():
    """The search for candidates is as wide as the hall is large."""
    far = np.array([[[-60.0, 0.0], [-59.0, 0.0]], [[59.0, 0.004], [60.0, 0.004]], [[-60.0, 80.0], [60.0, 80.0]]])
    assert collinear(far).tolist() == [0, 0, 1]


def test_the_truth_of_a_world_is_its_faces_and_what_the_robot_can_see(world):
    truth = truth_of(world, RobotConfig())
    np.testing.assert_array_equal(truth.faces, world.faces)
    assert len(set(truth.walls.tolist())) == 8
    assert truth.rings.tolist() == 4 * [0] + 4 * [1]
    for (a, b), (alpha, r) in zip(truth.faces, truth.lines, strict=True):
        n = np.array([np.cos(alpha), np.sin(alpha)])
        assert (n @ a, n @ b) == pytest.approx((r, r), abs=1e-12)
        assert n[0] * (b - a)[1] - n[1] * (b - a)[0] == pytest.approx(np.hypot(*(b - a)))
    assert truth.contour.length_m == pytest.approx(22.4)


@pytest.mark.parametrize("far_m", [0.0, 1e5])
def test_only_walls_that_lie_near_each_other_are_held_against_each_other(monkeypatch, far_m):
    """A plan of ten thousand walls has fifty million pairs."""
    rng, looked_at = np.random.default_rng(1), []
    plain = truth._offset
    monkeypatch.setattr(truth, "_offset", lambda faces, lines: looked_at.append(len(faces)) or plain(faces, lines))
    start = rng.uniform(0.0, 40.0, (300, 2))
    turn = 0.5 * np.pi * rng.integers(0, 4, 300)
    faces = np.stack([start, start + np.stack([np.cos(turn), np.sin(turn)], axis=-1)], axis=1) + np.array([far_m, 0.0])
    labels = collinear(faces)
    assert labels.dtype == np.int64
    assert max(looked_at) < 0.05 * 300 * 299 / 2
