"""How far walls on something round are from it: against tangents drawn along the arc."""

import numpy as np
import pytest

from chainslam.slam.geometry.circles import DEFAULT, cov_of_rounding, radius_of
from chainslam.slam.geometry.lines import through


def chords(radius_m, count=6, step=0.7):
    """Chords of a circle about the origin, free side on the left."""
    middles = step * np.arange(count)
    at = np.stack([middles + 0.4 * step, middles - 0.4 * step], axis=-1)
    return radius_m * np.stack([np.cos(at), np.sin(at)], axis=-1)


@pytest.mark.parametrize("radius_m", [0.1, 0.25, 0.5])
def test_the_radius_is_that_of_the_circle_that_most_walls_touch(radius_m):
    ends = chords(radius_m)
    found = [radius_of(row, through(ends), ends, DEFAULT) for row in range(len(ends))]
    np.testing.assert_allclose(found, radius_m * np.cos(0.28), rtol=1e-6)


@pytest.mark.parametrize("radius_m", [0.15, 0.4])
def test_what_is_stated_is_how_tangents_along_the_arc_differ_from_the_wall(radius_m):
    ends = chords(radius_m)
    stated = cov_of_rounding(through(ends), ends)[0]
    half = np.arcsin(min(0.5 * np.hypot(*(ends[0, 1] - ends[0, 0])) / (radius_m * np.cos(0.28)), 1.0))
    turns = np.linspace(-half, half, 2001)
    assert stated[0, 0] == pytest.approx(np.mean(turns**2), rel=0.01)
    assert stated[1, 1] == pytest.approx(np.mean((radius_m * np.cos(0.28) * (1.0 - np.cos(turns))) ** 2), rel=0.1)
    assert stated[0, 1] == 0.0


def test_a_box_a_long_wall_and_three_chords_state_nothing():
    box = 0.3 * np.array([[[0, 0], [0, 1]], [[0, 1], [1, 1]], [[1, 1], [1, 0]], [[1, 0], [0, 0]]], dtype=float)
    assert not cov_of_rounding(through(box + 0.1), box + 0.1).any()
    three = chords(0.3, 3)
    assert not cov_of_rounding(through(three), three).any()
    many = np.concatenate([chords(0.3), [[[2.0, -3.0], [2.0, 3.0]]]])
    stated = cov_of_rounding(through(many), many)
    assert stated[:-1, 0, 0].all()
    assert not stated[-1].any()
