"""What a scan says of free space: none where one return alone is missing, none where a beam tells nothing."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from chainslam.slam.backends import BACKENDS, BackendOptions
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, RobotError, Scan

FULL = np.linspace(-np.pi, np.pi, 12, endpoint=False)
PART = np.linspace(-1.0, 1.0, 12)
A_RANGE = st.one_of(st.just(np.inf), st.just(np.nan), st.floats(0.1, 3.9))


def around(ranges, k, full):
    """The beams before and after one; beyond the last of less than a full turn nothing contradicts."""
    return [ranges[n % 12] if full or 0 <= n < 12 else np.inf for n in (k - 1, k + 1)]


@given(st.lists(A_RANGE, min_size=12, max_size=12), st.booleans())
def test_free_space_is_told_by_returns_and_by_beams_whose_neighbours_have_none_either(ranges, full):
    scan = Scan(FULL if full else PART, np.array(ranges), 0.01, 4.0, 0.0)
    assert scan.is_full_turn == full
    for k, here in enumerate(ranges):
        beside = around(ranges, k, full)
        if np.isfinite(here):
            assert scan.passed_m[k] == scan.shown_m[k] == here
            continue
        assert scan.passed_m[k] == (4.0 if here == np.inf and beside == [np.inf, np.inf] else 0.0)
        if np.isfinite(beside).all():
            assert scan.shown_m[k] == min(beside)
        else:
            assert scan.shown_m[k] == (4.0 if here == np.inf else 0.0)


def test_each_beam_has_its_standard_deviation():
    ranges = np.array([1.0, 2.0, np.inf])
    np.testing.assert_array_equal(Scan(PART[:3], ranges, 0.01, 4.0, 0.0).sigmas_m, [0.01, 0.01, 0.01])
    own = np.array([0.01, 0.02, 0.03])
    np.testing.assert_array_equal(Scan(PART[:3], ranges, own, 4.0, 0.0).sigmas_m, own)
    shared = Scan(PART[:3], ranges, own, 4.0, 0.0, 0.02).sigmas_m
    np.testing.assert_allclose(shared, np.sqrt([0.01**2 + 0.02**2, 0.02**2 + 0.04**2, 0.03**2]))


RANGES = np.linspace(1.0, 2.0, 12)
NO_SCAN = {
    "all returns zero": (FULL, np.zeros(12), 0.01, 4.0, r"12 of 12 at 0 or below: give \+inf"),
    "one return zero": (FULL, np.where(np.arange(12) == 5, 0.0, RANGES), 0.01, 4.0, "1 of 12 at 0"),
    "nearer than nothing": (FULL, np.where(np.arange(12) == 5, -np.inf, RANGES), 0.01, 4.0, "1 of 12 at 0"),
    "the maximum range for no return": (FULL, np.where(np.arange(12) < 4, 4.0, RANGES), 0.01, 4.0, "4 at exactly"),
    "descending": (FULL[::-1].copy(), RANGES, 0.01, 4.0, "descending ones: `Scan.ordered`"),
    "a last beam that repeats the first": (np.linspace(0, 2 * np.pi, 12), RANGES, 0.01, 4.0, "stands there twice"),
    "uneven": (np.sort(PART + 0.1 * PART**2), RANGES, 0.01, 4.0, "steps of"),
    "a seam within": (np.roll(FULL, 3), RANGES, 0.01, 4.0, "`Scan.ordered`"),
    "no bearing": (np.where(np.arange(12) == 5, np.nan, FULL), RANGES, 0.01, 4.0, "no numbers"),
    "one beam": (FULL[:1], RANGES[:1], 0.01, 4.0, "two at least"),
    "noise below zero": (FULL, RANGES, -0.01, 4.0, "a noise of 0 m or more"),
    "no maximum": (FULL, RANGES, 0.01, float("nan"), "a maximum range above 0 m"),
}


@pytest.mark.parametrize("case", NO_SCAN)
def test_what_is_no_scan_is_told_in_one_line_with_what_to_do(case):
    bearings, ranges, sigma, most, words = NO_SCAN[case]
    with pytest.raises(RobotError, match=r"^expected .*, found .*: .*") as told:
        Scan(bearings, ranges, sigma, most, 0.0)
    assert "\n" not in str(told.value)
    with pytest.raises(RobotError, match=words):
        Scan(bearings, ranges, sigma, most, 0.0)


def test_a_return_or_two_at_the_maximum_range_and_a_scan_without_returns_are_scans():
    Scan(FULL, np.where(np.arange(12) < 3, 4.0, RANGES), 0.01, 4.0, 0.0)
    Scan(FULL, np.full(12, np.inf), 0.01, 4.0, 0.0)
    Scan(FULL, np.full(12, np.nan), 0.01, 4.0, 0.0)


def by_bearing(bearings, ranges, sigmas):
    """Each beam's range and noise by its number in a turn of twelve."""
    beams = np.round(np.mod(bearings, 2 * np.pi) / (2 * np.pi) * 12).astype(int) % 12
    return {int(beam): values for beam, *values in zip(beams, ranges.tolist(), sigmas.tolist(), strict=True)}


@pytest.mark.parametrize("start", [0, 3, 11])
@pytest.mark.parametrize("descending", [False, True])
@pytest.mark.parametrize("repeated", [False, True])
def test_beams_in_any_order_make_the_scan_that_they_are(start, descending, repeated):
    """As drivers give them: from -pi, from 0, clockwise, with a seam, with the first beam once more at the end."""
    bearings, sigmas = np.mod(FULL + np.pi, 2 * np.pi) - np.pi, np.linspace(0.01, 0.02, 12)
    order = np.roll(np.arange(12), -start)
    order = order[::-1] if descending else order
    order = np.append(order, order[0]) if repeated else order
    scan = Scan.ordered(bearings[order], RANGES[order], sigmas[order], 4.0, 1.5, 0.01)
    assert scan.is_full_turn
    assert len(scan.ranges_m) == 12
    assert by_bearing(scan.bearings_rad, scan.ranges_m, scan.sigma_m) == by_bearing(bearings, RANGES, sigmas)
    assert (scan.range_max_m, scan.time_s, scan.sigma_share) == (4.0, 1.5, 0.01)


def test_a_part_of_a_turn_is_turned_around_and_keeps_its_last_beam():
    scan = Scan.ordered(PART[::-1], RANGES[::-1], 0.01, 4.0, 0.0)
    np.testing.assert_array_equal(scan.bearings_rad, PART)
    np.testing.assert_array_equal(scan.ranges_m, RANGES)
    with pytest.raises(RobotError, match="steps of"):
        Scan.ordered(np.array([0.0, 0.1, 0.3]), RANGES[:3], 0.01, 4.0, 0.0)


def test_odometry_that_states_no_error_is_refused_before_anything_is_believed():
    backend = BACKENDS["full-ekf"].make(np.zeros(3), 1e-4 * np.eye(3), BackendOptions())
    mapper = Mapper(backend)
    with pytest.raises(RobotError, match="how far the wheels slip"):
        mapper.predict(Odometry(np.array([0.1, 0.0, 0.0]), np.zeros((3, 3))))
    np.testing.assert_array_equal(mapper.belief.pose_world, np.zeros(3))
    mapper.predict(Odometry(np.zeros(3), np.zeros((3, 3))))
    with pytest.raises(RobotError, match="finite numbers"):
        Odometry(np.array([0.1, np.nan, 0.0]), np.eye(3))


def test_returns_below_the_minimum_range_tell_nothing():
    """As ROS drivers say it (REP 117): -inf is too near, and so is any number below the minimum."""
    ranges = np.where(np.arange(12) == 3, 0.04, RANGES)
    ranges[[5, 7]] = 0.0, -np.inf
    scan = Scan.ordered(FULL, ranges, 0.01, 4.0, 0.0, range_min_m=0.05)
    np.testing.assert_array_equal(np.flatnonzero(np.isnan(scan.ranges_m)), [3, 5, 7])
    np.testing.assert_array_equal(scan.ranges_m[~np.isnan(scan.ranges_m)], np.delete(RANGES, [3, 5, 7]))
    with pytest.raises(RobotError, match="1 of 12 at 0"):
        Scan.ordered(FULL, np.where(np.arange(12) == 5, 0.0, RANGES), 0.01, 4.0, 0.0)


def test_a_scanner_that_reaches_less_far_sees_the_way_there_free_and_what_never_came_back_not_at_all():
    ranges = np.array([2.0, 30.0, np.inf, np.nan, 14.9])
    near = Scan(np.deg2rad(np.arange(5.0)), ranges, 0.02, 80.0, 0.0).within(15.0)
    np.testing.assert_array_equal(near.ranges_m, [2.0, np.inf, np.nan, np.nan, 14.9])
    assert near.range_max_m == 15.0
    assert near.within(40.0).range_max_m == 15.0


def test_rounding_counts_once_for_neighbours_that_were_rounded_to_one_range():
    """Four beams of one rounded range together weigh as much as one; those of other ranges have errors of their own."""
    ranges = np.array([1.0, 1.0, 1.0, 1.0, 1.025, 1.05, np.inf, np.nan])
    scan = Scan(0.1 * np.arange(8), ranges, 0.003, 4.0, 0.0, resolution_m=0.025)
    rounding = np.sqrt(scan.sigmas_m**2 - 0.003**2)
    np.testing.assert_allclose(rounding[:4], 2.0 * 0.025 / np.sqrt(12.0))
    np.testing.assert_allclose(rounding[4:6], 0.025 / np.sqrt(12.0))
    assert Scan(0.1 * np.arange(8), ranges, 0.003, 4.0, 0.0).sigmas_m.tolist() == [0.003] * 8
