"""Extraction: its covariance against Monte Carlo, its contract, its symmetries."""

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from scipy.stats import chi2

from chainslam.sim.lidar import LidarConfig, RangeFinder, noisy
from chainslam.slam.extraction.extract import extract
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.robot import Scan

SIGMA = 0.01


def loop(*corners):
    """Return the faces of a closed loop of corners, free side on the left."""
    points = np.array(corners, dtype=float)
    return np.stack([points, np.roll(points, -1, axis=0)], axis=1)


HALL = np.concatenate(
    [
        loop((0, 0), (3, 0), (3, -2.5), (4.2, -2.5), (4.2, 0), (6, 0), (6, 3.1), (2.5, 3.1), (2.5, 4.4), (0, 4.4)),
        loop((1.0, 1.0), (1.0, 1.5), (1.6, 1.5), (1.6, 1.0)),
        loop((4.4, 1.6), (4.1, 2.2), (4.7, 2.4)),
    ]
)
CLOSED = loop((0, 0), (3.2, 0), (3.2, 2.4), (0, 2.4))
PLACES = np.array([[2.1, 2.0], [3.5, 1.0], [0.6, 3.0], [5.4, 0.6], [3.6, -1.0]])


def scan_of(faces, pose, rng=None, config=None):
    """Return a scan; exact without a generator."""
    finder = RangeFinder(faces, config or LidarConfig())
    ranges, _ = finder.cast(np.asarray(pose, dtype=float))
    noise = np.zeros_like(ranges) if rng is None else rng.standard_normal(len(ranges))
    return Scan(finder.bearings_rad, noisy(ranges, SIGMA, noise), SIGMA, 4.0, 0.0)


def room_scan(seed):
    """Return a noisy scan from a random place in a random one of two worlds."""
    rng = np.random.default_rng(seed)
    faces, place = (CLOSED, rng.uniform(0.4, 2.0, 2)) if rng.random() < 0.4 else (HALL, PLACES[rng.integers(5)])
    return scan_of(faces, [*(place + rng.uniform(-0.1, 0.1, 2)), rng.uniform(-4.0, 4.0)], rng)


seeds = st.integers(0, 2**32)


def wall(offset, half_length=0.7, distance=1.5):
    """Return one wall ahead whose middle is `offset` to the left of the perpendicular's foot."""
    return np.array([[[distance, offset - half_length], [distance, offset + half_length]]])


# ---- the covariance


@pytest.mark.parametrize("offset", [0.0, 1.4, -2.2])
def test_covariance_equals_finite_differences_through_the_whole_extraction(offset):
    scan = scan_of(wall(offset), np.zeros(3))
    seen = np.flatnonzero(np.isfinite(scan.ranges_m))
    exact = extract(scan)
    assert len(exact) == 1
    columns = []
    for beam in seen:
        shifted = [np.where(np.arange(180) == beam, scan.ranges_m + h, scan.ranges_m) for h in (1e-5, -1e-5)]
        plus, minus = (extract(replace(scan, ranges_m=ranges)).lines[0] for ranges in shifted)
        columns.append((plus - minus) / 2e-5)
    jacobian = np.array(columns).T
    np.testing.assert_allclose(exact.cov[0], SIGMA**2 * jacobian @ jacobian.T, rtol=1e-4, atol=1e-12)


@pytest.mark.parametrize("offset", [0.0, 1.2, -1.8], ids=["centred", "left", "far right"])
def test_one_wall_is_calibrated_centred_and_off_to_one_side_alike(offset):
    rng = np.random.default_rng(4)
    exact = scan_of(wall(offset), np.zeros(3))
    errors, covs, pieces = [], [], 0
    for _ in range(3500):  # the 95th percentile is then known to 2.5 %
        segments = extract(replace(exact, ranges_m=exact.ranges_m + SIGMA * rng.standard_normal(180)))
        best = int(np.argmax(segments.beam_counts))
        pieces += len(segments)
        errors.append(segments.lines[best] - np.array([0.0, 1.5]))
        covs.append(segments.cov[best])
    assert pieces <= 3510
    e, c = np.array(errors), np.array(covs)
    values = np.einsum("ni,nij,nj->n", e, np.linalg.inv(c), e)
    assert np.median(values) == pytest.approx(chi2.median(2), rel=0.1)
    assert np.percentile(values, 95) == pytest.approx(chi2.ppf(0.95, 2), rel=0.1)
    np.testing.assert_allclose(np.var(e, axis=0), c.mean(axis=0).diagonal(), rtol=0.2)


def test_covariance_grows_with_the_square_of_the_stated_noise():
    scan = scan_of(CLOSED, [1.0, 1.0, 0.3])
    once, twice = extract(scan), extract(replace(scan, sigma_m=0.5 * SIGMA))
    assert len(once) == len(twice) == 4
    np.testing.assert_allclose(once.cov, 4.0 * twice.cov, rtol=0.3)


# ---- the contract


@given(seed=seeds)
@settings(max_examples=100, deadline=None)
def test_segments_keep_their_contract(seed):
    scan = room_scan(seed)
    segments = extract(scan)
    assert len(segments) >= 3
    assert np.all(segments.lines[:, 1] > 0)
    assert np.all(np.linalg.eigvalsh(segments.cov) > 0)
    n, t = normals(segments.lines[:, 0]), directions(segments.lines[:, 0])
    np.testing.assert_allclose(np.einsum("nej,nj->ne", segments.ends, n), segments.lines[:, 1:].repeat(2, 1), atol=1e-9)
    along = np.einsum("nej,nj->ne", segments.ends, t)
    assert np.all(along[:, 1] > along[:, 0])
    k = len(scan.ranges_m)
    runs = [np.arange(f, f + (last - f) % k + 1) % k for f, last in segments.beams]
    assert all(len(run) >= count >= 3 for run, count in zip(runs, segments.beam_counts, strict=True))
    used = np.concatenate(runs)
    assert len(np.unique(used)) == len(used)
    assert np.sum(np.diff(segments.beams[:, 0]) < 0) <= 1
    assert np.all(np.isfinite(scan.ranges_m[segments.beams]))
    first = segments.at_corner[:, 0]
    last = np.roll(segments.at_corner[:, 1], 1)
    assert np.array_equal(first, last)
    np.testing.assert_allclose(segments.ends[first, 0], np.roll(segments.ends[:, 1], 1, axis=0)[first], atol=1e-9)


@given(seed=seeds, steps=st.integers(1, 179))
@settings(max_examples=100, deadline=None)
def test_turning_the_robot_by_whole_beams_turns_the_lines_and_changes_nothing_else(seed, steps):
    scan = room_scan(seed)
    here, turned = extract(scan), extract(replace(scan, ranges_m=np.roll(scan.ranges_m, steps)))
    assert len(here) == len(turned)
    shift = steps * (scan.bearings_rad[1] - scan.bearings_rad[0])
    order = np.argsort((turned.beams[:, 0] - steps) % 180)
    turned, here = turned.take(order), here.take(np.argsort(here.beams[:, 0]))
    np.testing.assert_allclose(wrap(turned.lines[:, 0] - here.lines[:, 0] - shift), 0.0, atol=1e-9)
    np.testing.assert_allclose(turned.lines[:, 1], here.lines[:, 1], atol=1e-9)
    np.testing.assert_allclose(turned.cov, here.cov, rtol=1e-7, atol=1e-15)
    assert np.array_equal((turned.beams - steps) % 180, here.beams)
    assert np.array_equal(turned.at_corner, here.at_corner)
    assert np.array_equal(turned.beam_counts, here.beam_counts)


@given(seed=seeds)
@settings(max_examples=60, deadline=None)
def test_a_mirrored_scan_gives_mirrored_lines(seed):
    scan = room_scan(seed)
    here = extract(scan)
    there = extract(replace(scan, ranges_m=np.roll(scan.ranges_m[::-1], 1)))
    assert len(here) == len(there)
    there = there.take(np.argsort(wrap(-there.lines[:, 0])))
    here = here.take(np.argsort(wrap(here.lines[:, 0])))
    np.testing.assert_allclose(wrap(there.lines[:, 0] + here.lines[:, 0]), 0.0, atol=1e-8)
    np.testing.assert_allclose(there.lines[:, 1], here.lines[:, 1], atol=1e-8)
    assert np.array_equal(there.at_corner[:, ::-1], here.at_corner)


@pytest.mark.parametrize("heading", [0.0, 0.7, 3.1])
def test_an_errorless_room_is_four_walls_with_exact_corners(heading):
    segments = extract(scan_of(CLOSED, [1.0, 1.1, heading]))
    assert len(segments) == 4
    assert np.all(segments.at_corner)
    np.testing.assert_allclose(np.sort(segments.lines[:, 1]), [1.0, 1.1, 1.3, 2.2], atol=1e-9)
    corners = np.hypot(*segments.ends[:, 0].T)
    np.testing.assert_allclose(np.sort(corners), np.sort(np.hypot(*(CLOSED[:, 0] - [1.0, 1.1]).T)), atol=1e-9)


@pytest.mark.parametrize("is_noisy", [False, True])
def test_the_cut_between_two_walls_lies_where_they_meet_however_little_they_turn(is_noisy):
    """A bend of 3 degrees: the best cut of any one scale lies many beams off, and both lines would be wrong."""
    turn = np.deg2rad(3.0)
    bent = loop((-3, 0), (0, 0), (3 * np.cos(turn), 3 * np.sin(turn)), (3, 4), (-3, 4))
    rng, off, sigma = np.random.default_rng(3), [], []
    for _ in range(60):
        pose = np.array([*rng.uniform((-1.5, 0.4), (1.5, 1.5)), rng.uniform(-3.0, 3.0)])
        segments = extract(scan_of(bent, pose, rng if is_noisy else None))
        alpha = wrap(segments.lines[:, 0] + pose[2])
        below = np.abs(alpha + np.pi / 2 - turn / 2) < np.deg2rad(5.0)
        below = np.flatnonzero(below & (segments.beam_counts >= 10))
        if len(below) == 2:  # else one line was taken for both: there is no cut
            first, second = below[np.argsort(alpha[below])]
            off.append([alpha[first] + np.pi / 2, alpha[second] + np.pi / 2 - turn])
            sigma.append(np.sqrt(segments.cov[[first, second], 0, 0]))
    worst, nees = np.abs(off).max(), np.mean(np.square(np.array(off) / sigma))
    print(f"{len(off)} cuts: at worst {worst:.1e} rad, squared error over its variance {nees:.2f}")
    assert len(off) > 30
    assert nees < 1.6 if is_noisy else worst < 1e-9


@pytest.mark.parametrize("is_noisy", [False, True])
def test_a_long_wall_that_bends_a_little_is_two_walls(is_noisy):
    """1.8 degrees, 0.4 m away: at a scale of 20 beams nothing, hundreds in chi-square over the whole wall."""
    turn = np.deg2rad(1.8)
    bent = np.array([[[-4.0, 0.0], [0.0, 0.0]], [[0.0, 0.0], [4 * np.cos(turn), 4 * np.sin(turn)]]])
    rng, scores = np.random.default_rng(4), []
    for _ in range(60):
        pose = np.array([*rng.uniform((-0.4, 0.35), (0.4, 0.45)), rng.uniform(-3.0, 3.0)])
        segments = extract(scan_of(bent, pose, rng if is_noisy else None))
        long = segments.beam_counts >= 10
        alpha = np.sort(wrap(segments.lines[long, 0] + pose[2] + np.pi / 2))
        assert len(alpha) == 2, "one line for both walls"
        sigma = np.sqrt(segments.cov[long, 0, 0][np.argsort(wrap(segments.lines[long, 0] + pose[2]))])
        scores.append((alpha - [0.0, turn]) / sigma)
    assert np.mean(np.square(scores)) < 1.6 if is_noisy else np.abs(scores).max() < 1e-6


def test_a_half_turn_scanner_sees_the_same_walls_and_ends_with_its_view():
    pose = [1.0, 1.1, 0.0]
    half = extract(scan_of(CLOSED, pose, config=LidarConfig(beams=181, fov_rad=np.pi)))
    np.testing.assert_allclose(half.lines, [[-np.pi / 2, 1.1], [0.0, 2.2], [np.pi / 2, 1.3]], atol=1e-9)
    assert not half.at_corner[0, 0]
    assert not half.at_corner[-1, 1]


def test_a_gap_of_more_than_three_beams_parts_a_wall_and_a_single_missing_beam_does_not():
    scan = scan_of(wall(0.0, half_length=1.5), np.zeros(3))
    for missing, pieces in ((1, 1), (2, 1), (4, 2)):
        ranges = scan.ranges_m.copy()
        ranges[90 : 90 + missing] = np.inf
        assert len(extract(replace(scan, ranges_m=ranges))) == pieces


@given(
    ranges=st.lists(
        st.one_of(st.floats(0.0, 5.0), st.just(float("nan")), st.floats(allow_nan=True, allow_infinity=True)),
        min_size=2,
        max_size=40,
    ),
    half=st.booleans(),
    sigma=st.sampled_from([0.0, 1e-3, 0.01, 0.3]),
)
@settings(max_examples=300, deadline=None)
def test_no_scan_raises_and_what_comes_is_finite(ranges, half, sigma):
    k = len(ranges)
    bearings = np.linspace(-np.pi / 2, np.pi / 2, k) if half else np.linspace(-np.pi, np.pi, k, endpoint=False)
    measured = np.array(ranges)
    measured[(measured <= 0.0) | (measured == 4.0)] = np.nan
    segments = extract(Scan(bearings, measured, sigma, 4.0, 0.0))
    assert np.all(np.isfinite(segments.cov))
    assert np.all(np.isfinite(segments.ends))
    assert np.all(segments.lines[:, 1] > 0)


@pytest.mark.parametrize("ranges", [np.full(180, np.inf), np.full(180, 2.0), np.full(180, np.nan), np.full(2, 1.0)])
def test_degenerate_scans_are_answered(ranges):
    extract(Scan(np.linspace(-np.pi, np.pi, len(ranges), endpoint=False), ranges, SIGMA, 4.0, 0.0))
