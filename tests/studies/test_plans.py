"""The truth of a plan's dimensions, and drawings in which walls are moved."""

import numpy as np
import pytest
import shapely

from chainslam.experiments.views.plans.measuring import Kind
from chainslam.experiments.views.plans.survey import survey
from chainslam.sim.worlds import World
from studies.plans.moved_walls import with_moved
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
