"""Corners of the map and distances between named ones, in a square room of 5 m."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.experiments.scoring.maps.corners import LABEL_REACH_M, Corner, corners, label_distances
from chainslam.slam.geometry.poses import inverse, to_world
from chainslam.slam.map.chains import Chain, OpenEnd

SQUARE = np.array([[[0, 0], [5, 0]], [[5, 0], [5, 5]], [[5, 5], [0, 5]], [[0, 5], [0, 0]]], dtype=float)
IDS = np.array([2, 3, 7, 8])
STILL = np.zeros(3)


@pytest.fixture
def walls(make_map):
    return make_map(SQUARE, STILL, ids=IDS)


CLOSED = (Chain((2, 3, 7, 8), SQUARE[:, 1], ()),)


def test_a_closed_chain_has_a_corner_for_each_wall_and_an_open_one_between_them(walls):
    found = corners(walls, CLOSED)
    assert [corner.walls for corner in found] == [(2, 3), (3, 7), (7, 8), (8, 2)]
    assert [corner.position_world.tolist() for corner in found] == SQUARE[:, 1].tolist()
    ends = (OpenEnd(2, 0, SQUARE[0, 0]), OpenEnd(8, 1, SQUARE[3, 1]))
    two = (Chain((3,), np.zeros((0, 2)), ends), Chain((2, 3, 7), SQUARE[:2, 1], ends))
    assert [(corner.chain, corner.walls) for corner in corners(walls, two)] == [(1, (2, 3)), (1, (3, 7))]


def test_a_corner_depends_on_its_two_walls_alone(walls):
    """A wall moved by d carries the corner along; turned about its middle, 2.5 m away, by as much a radian."""
    corner = corners(walls, CLOSED)[1]
    expected = np.zeros((2, 3 + 8))
    # Walls 3 and 7 (rows 1 and 2): outward normals +x and +y, the corner is 2.5 m on from the one's middle.
    expected[0, 5:7], expected[1, 7:9] = [-2.5, 1.0], [2.5, 1.0]
    np.testing.assert_allclose(corner.jacobian, expected, atol=1e-9)
    joint = walls.belief.joint(IDS)
    np.testing.assert_allclose(corner.cov(joint), expected @ joint.cov @ expected.T, atol=1e-12)


def test_walls_on_one_line_have_no_corner_that_is_known(make_map):
    pieces = np.array([[[0.0, 0.0], [1.0, 0.0]], [[1.0, 0.0], [2.0, 0.0]]])
    walls = make_map(pieces, STILL)
    (corner,) = corners(walls, (Chain((0, 1), np.array([[1.0, 0.0]]), ()),))[:1]
    assert corner.jacobian is None
    assert corner.cov(walls.belief.joint(walls.ids)) is None


NAMES = {"C": (5.0, 5.0), "A": (0.1, 0.0), "B": (5.0, 0.3)}


def test_each_pair_of_names_is_measured_between_the_corners_nearest_to_them(walls):
    found = label_distances(corners(walls, CLOSED), NAMES, STILL, None)
    assert {pair: row["mapped_m"] for pair, row in found.items()} == pytest.approx(
        {"A-B": 5.0, "A-C": np.sqrt(50.0), "B-C": 5.0}
    )
    true = {"A-B": np.hypot(4.9, 0.3), "A-C": np.hypot(4.9, 5.0), "B-C": 4.7}
    assert {pair: row["true_m"] for pair, row in found.items()} == pytest.approx(true)
    assert list(found) == ["A-B", "A-C", "B-C"]
    assert {row["sigma_m"] for row in found.values()} == {None}


def test_names_are_looked_for_after_the_map_was_moved_to_the_truth(walls, make_map):
    moved = np.array([1.0, -2.0, 0.4])
    away = make_map(to_world(SQUARE, moved), STILL, ids=IDS)
    chains = (replace(CLOSED[0], corners_world=to_world(SQUARE[:, 1], moved)),)
    assert label_distances(corners(away, chains), NAMES, STILL, None)["B-C"]["mapped_m"] is None
    assert label_distances(corners(away, chains), NAMES, inverse(moved), None)["B-C"]["mapped_m"] == pytest.approx(5.0)


@pytest.mark.parametrize(("off_m", "is_found"), [(LABEL_REACH_M, True), (LABEL_REACH_M + 1e-9, False)])
def test_a_name_farther_than_half_a_metre_from_every_corner_is_not_mapped(walls, off_m, is_found):
    assert LABEL_REACH_M == 0.5
    found = label_distances(corners(walls, CLOSED), {"A": (0.0, off_m), "B": (5.0, 0.0)}, STILL, None)["A-B"]
    assert found["mapped_m"] == (pytest.approx(5.0) if is_found else None)
    assert found["true_m"] == pytest.approx(np.hypot(5.0, off_m))
    swapped = label_distances(corners(walls, CLOSED), {"B": (0.0, off_m), "A": (5.0, 0.0)}, STILL, None)["A-B"]
    assert (swapped["mapped_m"] is None) == (not is_found)
    assert label_distances([], {"A": (0.0, 0.0), "B": (5.0, 0.0)}, STILL, None) == {
        "A-B": {"true_m": 5.0, "mapped_m": None, "sigma_m": None}
    }


def test_the_deviation_of_a_distance_is_that_of_its_derivative(walls):
    """Along the diagonal all four walls count, each with its own sigma."""
    rng = np.random.default_rng(1)
    joint = walls.belief.joint(IDS)
    root = 0.01 * rng.normal(size=joint.cov.shape)
    joint = replace(joint, cov=root @ root.T)
    found = corners(walls, CLOSED)
    at = {"A": (0.0, 0.0), "C": (5.0, 5.0)}
    sigma = label_distances(found, at, STILL, joint)["A-C"]["sigma_m"]
    along = np.array([1.0, 1.0]) / np.sqrt(2.0)
    gradient = along @ (found[1].jacobian - found[3].jacobian)
    assert sigma == pytest.approx(np.sqrt(gradient @ joint.cov @ gradient))
    assert label_distances(found, at, STILL, None)["A-C"] == {
        "true_m": pytest.approx(np.sqrt(50.0)), "mapped_m": pytest.approx(np.sqrt(50.0)), "sigma_m": None,
    }  # fmt: skip
    # Rounding may leave a variance a little below zero.
    assert label_distances(found, at, STILL, replace(joint, cov=-1e-20 * np.eye(11)))["A-C"]["sigma_m"] == 0.0


def test_a_distance_has_no_deviation_where_a_corner_is_not_known_or_both_names_are_one(walls):
    joint = walls.belief.joint(IDS)
    found = corners(walls, CLOSED)
    for unknown in (1, 3):
        some = [replace(c, jacobian=None) if k == unknown else c for k, c in enumerate(found)]
        row = label_distances(some, {"A": (0.0, 0.0), "C": (5.0, 5.0)}, STILL, joint)["A-C"]
        assert (row["mapped_m"], row["sigma_m"]) == (pytest.approx(np.sqrt(50.0)), None)
    row = label_distances(found, {"A": (0.0, 0.0), "B": (0.1, 0.0)}, STILL, joint)["A-B"]
    assert row == {"true_m": pytest.approx(0.1), "mapped_m": 0.0, "sigma_m": None}
    close = [Corner(0, (2, 3), np.array([0.5, 0.0]), found[0].jacobian), found[3]]
    assert label_distances(close, {"A": (0.0, 0.0), "B": (0.6, 0.0)}, STILL, joint)["A-B"]["sigma_m"] > 0.0
