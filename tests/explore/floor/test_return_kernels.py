"""The loops over returns against plain formulations of the same."""

from itertools import groupby, pairwise

import numpy as np
import pytest

from chainslam.explore.floor.return_kernels import hits_of, lengths_of_runs, must_meet, same_places
from chainslam.slam.geometry.poses import wrap


def runs_of(flags, is_full_turn):
    """Return the rows of each run of flags; over a full turn the last row is followed by the first."""
    first = int(np.argmin(flags)) if is_full_turn else 0
    rows = [(first + k) % len(flags) for k in range(len(flags))]
    return [list(run) for flag, run in groupby(rows, key=lambda row: bool(flags[row])) if flag]


@pytest.mark.parametrize("is_full_turn", [True, False])
def test_each_beam_of_a_run_held_whole_has_its_length(is_full_turn):
    rng = np.random.default_rng(1)
    for share in np.repeat([0.0, 0.3, 0.7, 0.9, 1.0], 40):
        flags, held = rng.random(12) < share, rng.random(12) < 0.8
        expected = np.zeros(12)
        for run in runs_of(flags, is_full_turn):
            expected[run] = len(run) * held[run].all()
        np.testing.assert_array_equal(lengths_of_runs(flags, held, is_full_turn), expected)
    assert runs_of(np.array([True, True, False, True, False, False, True]), True) == [[3], [6, 0, 1]]


@pytest.mark.parametrize("fov_rad", [2.0 * np.pi, 4.0])
def test_beams_and_their_neighbours_must_meet_what_crosses_their_rays_from_right_to_left(fov_rad):
    rng, found = np.random.default_rng(2), 0
    beams, step_rad = 90, fov_rad / 90
    bearings = -0.5 * fov_rad + step_rad * np.arange(beams)
    ahead = np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)
    for _ in range(30):
        at = np.linspace(-np.pi, np.pi, 70) + rng.normal(0.0, 0.03, 70)
        points = rng.uniform(1.9, 2.1, (70, 1)) * np.stack([np.cos(at), np.sin(at)], axis=-1)
        points[rng.random(70) < 0.04] = np.nan
        met = np.zeros(beams, dtype=bool)
        for a, b in pairwise(points):
            is_held = np.hypot(*(b - a)) < 0.3 and max(np.hypot(*a), np.hypot(*b)) < 2.08 and a[0] * b[1] > a[1] * b[0]
            if is_held and (fov_rad > 6.0 or np.arctan2(a[1], a[0]) > bearings[0]):
                from_a, to_b = a[0] * ahead[:, 1] - a[1] * ahead[:, 0], ahead[:, 0] * b[1] - ahead[:, 1] * b[0]
                met |= (from_a >= 0.0) & (to_b >= 0.0) & (ahead @ (a + b) > 0.0)
        expected = np.all([np.roll(met, k) for k in range(-2, 3)], axis=0)
        told = must_meet(points, beams, bearings[0], step_rad, fov_rad > 6.0, 2.08, 0.3, 2)
        np.testing.assert_array_equal(told, expected)
        found += np.count_nonzero(told)
    assert 300 < found < 2400


def test_two_returns_are_of_one_place_if_they_are_near_in_bearing_and_distance():
    rng = np.random.default_rng(3)
    for count in (0, 1, 30):
        points, recent = rng.uniform(-1.0, 1.0, (40, 2)), rng.uniform(-1.0, 1.0, (count, 2))
        same_m = rng.uniform(0.1, 0.4, 40)
        near, rho, before, same = same_places(points, same_m, recent, 0.7, 0.5)
        (away, bearing), (distance, at) = ((np.hypot(*p.T), np.arctan2(p[:, 1], p[:, 0])) for p in (points, recent))
        np.testing.assert_array_equal(near, np.flatnonzero(away < 0.7))
        np.testing.assert_allclose(rho, away[near])
        np.testing.assert_allclose(before, distance)
        is_beside = np.abs(wrap(bearing[near, None] - at)) < 0.5
        np.testing.assert_array_equal(same, is_beside & (np.abs(rho[:, None] - before) < same_m[near, None]))


def test_only_beams_with_a_return_hit_something():
    ranges = np.array([1.0, np.inf, 2.0, np.nan])
    np.testing.assert_allclose(hits_of(np.arange(4) * 0.5 * np.pi, ranges), [[1.0, 0.0], [-2.0, 0.0]], atol=1e-12)
