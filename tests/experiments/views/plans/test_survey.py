"""Dimensions of a building of two rooms: their values as drawn, and their sigmas as by drawing many maps."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry.polygon import orient

from chainslam.experiments.views.plans.faces import END, Node
from chainslam.experiments.views.plans.measuring import Kind, commonest, value_of
from chainslam.experiments.views.plans.openings import gaps
from chainslam.experiments.views.plans.survey import survey

from .buildings import SIGMAS, drawn_from, mapped, two_rooms


@pytest.fixture(scope="module")
def found():
    return survey(mapped(two_rooms()))


def of_kind(found, kind):
    return sorted(round(each.measured.value, 6) for each in found.dimensions if each.kind is kind)


def test_dimensions_are_those_of_the_drawing(found):
    assert {3.0, 4.0} <= set(of_kind(found, Kind.WIDTH))
    assert of_kind(found, Kind.THICKNESS) == [0.1, 0.1]
    assert set(of_kind(found, Kind.OPENING)) == {0.9}
    assert of_kind(found, Kind.OVERALL) == [3.0, 7.1]
    assert of_kind(found, Kind.AREA) == [9.0, 12.0]
    assert of_kind(found, Kind.PERIMETER) == [12.0, 14.0]
    assert [room.openings for room in found.rooms] == [1, 1]


def test_sigmas_are_the_scatter_of_maps_drawn_from_the_covariance(found):
    chance = np.random.default_rng(1)
    maps = [drawn_from(found.faces, chance) for _ in range(400)]
    for each in found.dimensions:
        values = [value_of(faces, each).value for faces in maps]
        assert np.mean(values) == pytest.approx(each.measured.value, abs=0.25 * each.measured.sigma)
        assert np.std(values) == pytest.approx(each.measured.sigma, rel=0.15)


def test_errors_that_all_walls_share_are_in_no_dimension(found):
    faces = found.faces
    arm = np.zeros((2 * len(faces) + 3, 3))
    arm[3::2, 2] = 1.0
    arm[4::2, :2] = np.stack([np.cos(faces.means[:, 0]), np.sin(faces.means[:, 0])], axis=-1)
    arm[4::2, 2] = faces.anchors[:, 1] * arm[4::2, 0] * -1.0 + faces.anchors[:, 0] * arm[4::2, 1]
    moved = survey(replace(faces, cov=arm @ np.diag([0.01, 0.01, 0.001]) @ arm.T))
    assert max(each.measured.sigma for each in moved.dimensions) < 1e-6
    assert moved.direction.sigma == pytest.approx(0.001**0.5)


@pytest.mark.parametrize("degrees", [-40.0, 10.0, 30.0])
def test_the_main_direction_turns_with_the_map(degrees):
    turned = survey(mapped(two_rooms(), np.deg2rad(degrees)))
    assert np.rad2deg(turned.direction.value) == pytest.approx(degrees)
    assert of_kind(turned, Kind.AREA) == [9.0, 12.0]
    assert 0.0 < turned.direction.sigma < SIGMAS[0]


def test_furniture_has_no_dimensions_and_takes_no_area():
    faces = mapped(two_rooms(furniture=True))
    found = survey(faces)
    assert found.furniture == set(faces.chains[1])
    assert of_kind(found, Kind.AREA) == [9.0, 12.0]
    assert not any(set(each.walls) & found.furniture for each in found.dimensions)


@pytest.mark.parametrize(
    ("thick_m", "low_m", "high_m", "is_wall"), [(0.1, 0.9, 2.1, True), (0.4, 0.9, 2.1, False), (0.1, 1.0, 1.7, False)]
)
def test_a_piece_of_wall_that_stands_alone_divides_rooms_and_a_cupboard_does_not(thick_m, low_m, high_m, is_wall):
    """Between the piece and the walls of a room of 8 x 3 m there is an opening on either side."""
    floor = shapely.box(0, 0, 8, 3).difference(shapely.box(4, low_m, 4 + thick_m, high_m))
    faces = mapped(orient(floor, 1.0))
    found = survey(faces)
    assert found.furniture == (set() if is_wall else set(faces.chains[1]))
    assert (thick_m in of_kind(found, Kind.THICKNESS)) == is_wall
    assert (4.0 in of_kind(found, Kind.WIDTH)) == is_wall


def test_a_wall_that_stops_has_an_end_known_to_centimetres():
    whole = mapped(two_rooms())
    faces = replace(whole, chains=(whole.chains[0][1:-1],), closed=(False,))
    first = faces.chains[0][0]
    node = faces.node(first, 0)
    assert node == Node(first, END, 0)
    along = np.sqrt(np.linalg.eigvalsh(faces.points([node]).cov[0, :, 0]).max())
    assert along == pytest.approx(0.035, rel=0.01)


def test_a_gap_between_ends_is_an_opening_once_the_robot_saw_through_it():
    faces = mapped(two_rooms())
    jambs = [row for row in range(len(faces)) if faces.lengths_m[row] < 0.2]
    chains = [chain for row in range(len(faces)) if row not in jambs for chain in [(row,)]]
    loose = replace(faces, chains=tuple(chains), closed=(False,) * len(chains))
    assert not any(gap.is_seen for gap in gaps(loose))
    floor = two_rooms()
    solid = shapely.box(-1, -1, 9, 4).difference(floor)
    doors = [gap for gap in gaps(loose, solid) if gap.is_seen]
    assert {round(gap.width_m, 6) for gap in doors} == {0.9}


def test_walls_that_stand_askew_do_not_turn_the_main_direction():
    alpha = np.deg2rad([10.0, 100.5, 190.2, -79.9, 24.0, 204.0, 40.0])
    lengths = np.array([4.0, 3.0, 4.0, 3.0, 2.0, 2.0, 5.0])
    phi, share = commonest(alpha, lengths)
    assert np.rad2deg(phi) == pytest.approx(10.0 + (3.0 * 0.5 + 4.0 * 0.2 + 3.0 * 0.1) / 14.0)
    np.testing.assert_array_equal(share, [4.0, 3.0, 4.0, 3.0, 0.0, 0.0, 0.0])
    assert commonest(np.zeros(0), np.zeros(0))[0] == 0.0
