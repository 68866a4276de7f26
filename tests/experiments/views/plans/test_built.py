"""A map against a drawing: moved walls are found, others are left alone at the stated rate, wherever the map lies."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from chainslam.experiments.usage import UsageError
from chainslam.experiments.views.plans.against.alignment import align, saw_through
from chainslam.experiments.views.plans.against.built import Verdict, compare
from chainslam.slam.geometry.poses import inverse

from .buildings import drawn_from, edges, mapped, two_rooms

FLOOR = two_rooms()
DESIGN = np.concatenate(edges(FLOOR))
NOWHERE = np.zeros(len(DESIGN), dtype=bool)


def verdicts(faces, tolerance=0.0, false_alarms=0.05, free=NOWHERE, design=DESIGN):
    return compare(faces, design, align(faces, design, np.zeros(3)), tolerance, false_alarms, free)


def moved(compared):
    return {each.face: each for each in compared.findings if each.verdict is Verdict.MOVED}


def test_a_building_as_drawn_raises_false_alarms_at_no_more_than_the_stated_rate():
    chance = np.random.default_rng(1)
    alarms = [bool(moved(verdicts(drawn_from(mapped(FLOOR), chance), false_alarms=0.2))) for _ in range(150)]
    assert 0.02 <= np.mean(alarms) <= 0.2 + 2.0 * np.sqrt(0.2 * 0.8 / 150)


@pytest.mark.parametrize("by_m", [-0.08, 0.02])
def test_walls_that_stand_elsewhere_are_found_with_an_interval(by_m):
    chance, long = np.random.default_rng(2), [row for row in range(len(DESIGN)) if mapped(FLOOR).lengths_m[row] > 2.5]
    hits = 0
    for face in long:
        faces = drawn_from(mapped(FLOOR), chance)
        means = faces.means.copy()
        means[face, 1] += by_m
        found = moved(verdicts(replace(faces, means=means)))
        hits += face in found and abs(found[face].shift.value - by_m) <= 2.6 * found[face].shift.sigma
    assert hits >= len(long) - 1


def test_within_the_tolerance_nothing_is_moved_and_what_is_known_well_is_within():
    faces = mapped(FLOOR)
    means = faces.means.copy()
    means[2, 1] += 0.008
    compared = verdicts(replace(faces, means=means), tolerance=0.02)
    assert not moved(compared)
    assert compared.findings[0].verdict is Verdict.WITHIN


def test_a_map_that_lies_anywhere_is_matched():
    pose = np.array([3.0, -2.0, 2.0])
    turned = mapped(FLOOR, pose[2])
    shifted = replace(turned, anchors=turned.anchors + pose[:2])
    assert align(shifted, DESIGN, None) == pytest.approx(inverse(pose), abs=1e-6)


def test_two_places_in_a_symmetric_building_are_told():
    square = shapely.box(0, 0, 4, 4)
    with pytest.raises(UsageError, match="two that fit"):
        align(mapped(square), np.concatenate(edges(square)), None)


def test_another_building_is_refused():
    with pytest.raises(UsageError, match="walls on those of the drawing"):
        align(mapped(FLOOR), np.concatenate(edges(shapely.box(0, 0, 30, 22))), None)


def test_what_was_seen_free_is_missing_and_what_is_not_drawn_is_extra():
    column = shapely.box(1, 1, 1.8, 1.6)
    with_column = np.concatenate(edges(two_rooms(furniture=True)))
    free = saw_through(shapely.box(-1, -1, 9, 4).difference(FLOOR), with_column, np.zeros(3))
    missing = [
        each
        for each in verdicts(mapped(FLOOR), design=with_column, free=free).findings
        if each.verdict is Verdict.MISSING
    ]
    assert len(missing) == 4
    assert all(column.distance(shapely.Point(with_column[each.face].mean(axis=0))) < 1e-9 for each in missing)
    extra = [each for each in verdicts(mapped(two_rooms(furniture=True))).findings if each.verdict is Verdict.EXTRA]
    assert len(extra) == 4
    hidden = verdicts(mapped(FLOOR), design=with_column, free=np.zeros(len(with_column), dtype=bool))
    assert sum(each.verdict is Verdict.UNSEEN for each in hidden.findings) == 4
