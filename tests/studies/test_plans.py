"""The truth of a plan's dimensions, and drawings in which walls are moved."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from chainslam.experiments.views.plans.measuring import Kind
from chainslam.experiments.views.plans.structure import Relation, structure_of
from chainslam.experiments.views.plans.survey import survey
from chainslam.sim.worlds import World
from studies.plans.moved_walls import with_moved
from studies.plans.skewed_walls import as_masons_do, sheared, with_turned
from studies.plans.structure import anees, is_true
from studies.plans.truth import true_value, with_truth
from tests.experiments.views.plans.buildings import drawn_from, edges, mapped, two_rooms


def test_true_dimensions_are_those_of_the_true_walls():
    floor = two_rooms()
    faces = drawn_from(mapped(floor), np.random.default_rng(3))
    true_faces = np.concatenate(edges(floor))
    face_of = np.arange(len(faces))
    truth = with_truth(faces, face_of, true_faces, face_of)
    told = [(each.kind, *true_value(each, truth, faces, face_of, true_faces)) for each in survey(faces).dimensions]
    assert all(exists for *_, exists in told)
    assert sorted(round(value, 6) for kind, value, _ in told if kind is Kind.AREA) == [9.0, 12.0]
    assert {round(value, 6) for kind, value, _ in told if kind is Kind.OPENING} == {0.9}
    labels = np.where(face_of == 0, 1, face_of)
    merged = np.where(face_of == 0, -1, face_of)
    lost = with_truth(faces, merged, true_faces, labels)
    assert any(true_value(each, lost, faces, merged, true_faces) == (None, False) for each in survey(faces).dimensions)


@pytest.mark.parametrize("seed", range(5))
def test_moved_faces_change_the_floor_by_their_length_times_their_shift(seed):
    world = World("two rooms", two_rooms(), np.array([2.0, 1.5, 0.0]), {})
    changed, moved = with_moved(world, 2, seed)
    assert moved
    assert all(0.01 <= abs(each.by_m) <= 0.1 for each in moved)
    strips = [shapely.LineString(world.faces[each.face]).length * abs(each.by_m) for each in moved]
    assert changed.free.symmetric_difference(world.free).area == pytest.approx(sum(strips), rel=0.1)
    assert len(changed.faces) == len(world.faces)


def test_turned_walls_keep_the_floor_in_one_piece_and_turn_as_asked():
    world = World("two rooms", two_rooms(), np.array([2.0, 1.5, 0.0]), {})
    askew = with_turned(world, 0.5, 3.0)
    sides = askew.faces[:, 1] - askew.faces[:, 0]
    turns = np.rad2deg((np.arctan2(sides[:, 1], sides[:, 0]) + 0.25 * np.pi) % (0.5 * np.pi) - 0.25 * np.pi)
    assert len(askew.faces) == len(world.faces)
    assert askew.free.exterior.is_ccw
    assert np.all(np.abs(turns) < 3.0 + 1e-3)
    assert np.mean(np.abs(turns) > 0.5 - 1e-3) > 0.8
    lean = sheared(world, 1.5)
    assert lean.free.area == pytest.approx(world.free.area)
    masons = as_masons_do(world, 0.1)
    assert masons.free.symmetric_difference(world.free).area < 0.1


def test_relations_of_true_walls_are_true_and_the_rest_is_not():
    floor = two_rooms()
    truth = mapped(floor)
    found = structure_of(drawn_from(truth, np.random.default_rng(1)))
    directions = [each for each in found.hypotheses if each.relation in (Relation.PARALLEL, Relation.RIGHT_ANGLE)]
    assert directions
    assert all(is_true(each, truth) for each in found.hypotheses if each.is_used)
    row = directions[0].walls[0]
    askew = replace(truth, means=truth.means + np.outer(np.arange(len(truth)) == row, [np.deg2rad(1.0), 0.0]))
    assert not is_true(directions[0], askew)
    assert anees(truth, truth, np.arange(len(truth))) == pytest.approx(0.0, abs=1e-12)
