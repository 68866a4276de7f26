"""The limits of a plan's rules, from both sides: what is just within counts, what is just beyond does not."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from shapely.geometry.polygon import orient

from chainslam.experiments.views.plans.against.alignment import align
from chainslam.experiments.views.plans.against.built import Verdict, compare
from chainslam.experiments.views.plans.measuring import Kind, commonest, value_of
from chainslam.experiments.views.plans.openings import gaps
from chainslam.experiments.views.plans.survey import survey

from .buildings import edges, mapped, two_rooms


def surveyed(*parts, without=None):
    floor = shapely.union_all(parts).simplify(1e-9)
    return survey(mapped(orient(floor if without is None else floor.difference(without), 1.0)))


def values(found, kind):
    return sorted(round(each.measured.value, 6) for each in found.dimensions if each.kind is kind)


def doorway(width_m, thick_m=0.1):
    door = shapely.box(3.9, 3, 4.1 + thick_m, 3 + width_m)
    return shapely.box(0, 0, 4, 9), shapely.box(4 + thick_m, 0, 7 + thick_m, 9), door


@pytest.mark.parametrize(("width_m", "count"), [(0.3, 0), (0.4, 1), (2.4, 1), (2.6, 0)])
def test_openings_are_no_crack_and_no_missing_wall(width_m, count):
    floor = orient(shapely.union_all(doorway(width_m)).simplify(1e-9), 1.0)
    assert {round(gap.width_m, 6) for gap in gaps(mapped(floor))} == ({width_m} if count else set())


@pytest.mark.parametrize(("thick_m", "is_wall"), [(0.55, True), (0.65, False)])
def test_two_faces_far_apart_are_not_those_of_one_wall(thick_m, is_wall):
    assert bool(values(surveyed(*doorway(0.9, thick_m)), Kind.THICKNESS)) == is_wall


@pytest.mark.parametrize(("wide_m", "is_told"), [(0.4, False), (0.6, True)])
def test_walls_that_hardly_face_each_other_have_no_distance(wide_m, is_told):
    found = surveyed(shapely.box(0, 0, 4, 3), shapely.box(1, 3, 1 + wide_m, 3.7))
    assert (3.7 in values(found, Kind.WIDTH)) == is_told


@pytest.mark.parametrize(("wide_m", "is_told"), [(14.0, True), (16.0, False)])
def test_walls_too_far_apart_have_no_width(wide_m, is_told):
    assert (wide_m in values(surveyed(shapely.box(0, 0, wide_m, 3)), Kind.WIDTH)) == is_told


@pytest.mark.parametrize(("degrees", "count"), [(2.5, 2), (3.5, 1)])
def test_walls_that_are_not_parallel_have_no_distance(degrees, count):
    top = 3.0 + 4.0 * np.tan(np.deg2rad(degrees))
    assert len(values(surveyed(shapely.Polygon([(0, 0), (4, 0), (4, top), (0, 3)])), Kind.WIDTH)) == count


@pytest.mark.parametrize(("wide_m", "area_m2"), [(1.9, 36.0), (2.1, 31.8)])
def test_a_small_thing_takes_no_area_and_a_large_one_does(wide_m, area_m2):
    found = surveyed(shapely.box(0, 0, 6, 6), without=shapely.box(2, 2, 2 + wide_m, 4))
    assert values(found, Kind.AREA) == [area_m2]
    (room,) = (each for each in found.dimensions if each.kind is Kind.AREA)
    gradient = []
    for k in range(found.faces.means.size):
        means = found.faces.means.copy()
        means.flat[k] += 1e-6
        gradient.append((value_of(replace(found.faces, means=means), room).value - area_m2) / 1e-6)
    variance = gradient @ found.faces.cov[3:, 3:] @ gradient
    assert room.measured.sigma == pytest.approx(variance**0.5, rel=1e-3)


@pytest.mark.parametrize(("wide_m", "count"), [(0.9, 0), (1.1, 1)])
def test_a_space_smaller_than_a_square_metre_is_no_room(wide_m, count):
    assert len(surveyed(shapely.box(0, 0, wide_m, 1)).rooms) == count


def test_the_main_direction_is_that_of_the_longest_walls():
    phi, share = commonest(np.deg2rad([0.0, 20.0, 91.0]), np.array([10.0, 9.0, 1.0]))
    assert np.rad2deg(phi) == pytest.approx(1.0 / 11.0)
    assert share.tolist() == [10.0, 0.0, 1.0]


FLOOR = two_rooms()
DESIGN = np.concatenate(edges(FLOOR))
LONG = int(mapped(FLOOR).lengths_m.argmax())


def verdict(by_m, tolerance_m, known=1.0, design=DESIGN, floor=FLOOR, face=LONG):
    """What is said of a face of a building that stands elsewhere, in a map with sigmas `known` times as large."""
    faces = mapped(floor)
    means = faces.means.copy()
    means[face, 1] += by_m
    faces = replace(faces, means=means, cov=known**2 * faces.cov)
    pose = align(faces, design, np.zeros(3))
    found = compare(faces, design, pose, tolerance_m, 0.05, np.zeros(len(design), dtype=bool))
    return {each.face: each.verdict for each in found.findings if each.verdict is not Verdict.EXTRA}


def test_within_is_said_of_a_whole_interval_and_moved_beyond_the_tolerance_alone():
    assert verdict(0.0, 0.02)[LONG] is Verdict.WITHIN
    assert verdict(0.0195, 0.02)[LONG] is Verdict.UNCLEAR
    assert verdict(0.06, 0.02)[LONG] is Verdict.MOVED


def test_what_lines_err_by_besides_their_noise_moves_no_wall():
    assert Verdict.MOVED not in verdict(0.0003, 0.0, known=1e-3).values()
    assert verdict(0.003, 0.0, known=0.1)[LONG] is Verdict.MOVED


def test_a_step_that_the_mapper_cannot_see_moves_no_wall():
    floor = orient(shapely.box(0, 0, 4, 3), 1.0)
    stepped = shapely.Polygon([(0, 0), (4, 0), (4, 3.006), (2, 3.006), (2, 3), (0, 3)])
    told = verdict(0.0, 0.0, known=0.1, design=np.concatenate(edges(orient(stepped, 1.0))), floor=floor, face=0)
    assert Verdict.MOVED not in told.values()


def test_the_pose_of_the_map_is_found_from_a_rough_one():
    found = compare(mapped(FLOOR), DESIGN, np.array([0.01, -0.01, 0.002]), 0.0, 0.05, np.zeros(len(DESIGN), dtype=bool))
    assert found.pose == pytest.approx(np.zeros(3), abs=1e-3)
