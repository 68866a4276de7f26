"""A bias and a scale of ranges: against dense least squares, finite differences and simulated ways and scans."""

import numpy as np
import pytest
import shapely
from scipy.optimize import approx_fprime

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.association.kernels.bow_kernels import bows
from chainslam.slam.association.ranges.bias import RangeBias
from chainslam.slam.association.ranges.calibrated_backend import CalibratedBackend
from chainslam.slam.association.ranges.errors import RangeErrors, RangesConfig
from chainslam.slam.association.ranges.heard import Ranges
from chainslam.slam.association.ranges.scale import RangeScale
from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.geometry.poses import compose, rotation, wrap
from chainslam.slam.robot import LidarSpec, Odometry, RobotSpec, Scan
from tests.slam.test_mapper import faces_of

SIGMA_M = 0.01
CONFIG = RangesConfig()


def room(rng):
    """Faces of a rectangular room, and places in it."""
    width, depth = rng.uniform(2.5, 5.0, 2)
    places = np.column_stack(
        [rng.uniform(0.5, width - 0.5, 40), rng.uniform(0.5, depth - 0.5, 40), rng.uniform(-3, 3, 40)]
    )
    return faces_of(shapely.box(0, 0, width, depth)), places


def scans(rng, bias_m=0.0, scale=1.0, beams=180):
    faces, places = room(rng)
    finder = RangeFinder(faces, LidarConfig(beams=beams, range_max_m=8.0))
    for place in places:
        ranges = scale * finder.cast(place)[0] + bias_m + SIGMA_M * rng.standard_normal(beams)
        yield Scan(finder.bearings_rad, ranges, SIGMA_M, 8.0, 0.0)


def told(some_scans, config=CONFIG):
    """The bias as so many scans tell it, each segment a wall of its own."""
    bias = RangeBias(config)
    for k, scan in enumerate(some_scans):
        segments = extract(scan, ExtractionConfig())
        bias.learn(bias.seen(scan, segments, 0.0), 100 * k + np.arange(len(segments)))
    return bias


def test_what_a_segment_tells_is_the_schur_complement_of_dense_least_squares():
    """In the line's own parameters (alpha, r) and the bias together, by finite differences."""
    rng = np.random.default_rng(2)
    alpha, r = 0.4, 1.3
    bearings = np.linspace(alpha - 0.5, alpha + 1.0, 40)
    ranges = r / np.cos(bearings - alpha) + 0.004 * rng.standard_normal(40)
    found = bows(bearings, ranges, np.full(40, SIGMA_M), np.array([[alpha, r]]), np.array([[0, 39]]), 4.0)[0]
    J = np.array([approx_fprime([alpha, r], lambda x, t=t: x[1] / np.cos(t - x[0]), 1e-7) for t in bearings])
    J, e = np.column_stack([J, np.ones(40)]) / SIGMA_M, (ranges - r / np.cos(bearings - alpha)) / SIGMA_M
    solution, *_ = np.linalg.lstsq(J, e, rcond=None)
    cov = np.linalg.inv(J.T @ J)
    assert found[0] == pytest.approx(1.0 / cov[2, 2], rel=1e-4)
    assert found[1] / found[0] == pytest.approx(solution[2], rel=1e-3)
    by_bias, *_ = np.linalg.lstsq(J[:, :2], np.ones(40) / SIGMA_M, rcond=None)
    np.testing.assert_allclose(found[2:], by_bias, rtol=1e-4)


@pytest.mark.parametrize("bias_m", [-0.02, 0.0, 0.01])
def test_a_bias_is_told_within_its_sigma(bias_m):
    for seed in range(4):
        bias = told(scans(np.random.default_rng(seed), bias_m))
        assert bias.sigma_m < 0.0015
        assert abs(bias.mean_m - bias_m) < 4.0 * bias.sigma_m + 0.15 * abs(bias_m)


def test_a_scale_is_no_bias():
    bias = told(scans(np.random.default_rng(5), scale=1.02))
    assert abs(bias.mean_m) < 4.0 * bias.sigma_m


def test_walls_that_are_not_straight_make_the_bias_less_sure():
    """Each of ten walls bows by an amount of its own, the same in every scan: by noise alone it would seem sure."""
    rng, bias = np.random.default_rng(1), RangeBias()
    for wall, bow in enumerate(0.05 * rng.standard_normal(10)):
        sums = np.tile([200.0**2, 200.0**2 * bow], (30, 1))
        bias.learn(sums, np.full(30, wall))
    assert bias.sigma_m > 10.0 / (200.0 * np.sqrt(300.0))
    assert abs(bias.mean_m) < 3.0 * bias.sigma_m


def test_what_tells_too_little_alone_is_left_out():
    """A pillar's piece of few beams bows by its roundness, whatever the ranges."""
    finder = RangeFinder(faces_of(shapely.Point(1.2, 0.0).buffer(0.2).envelope), LidarConfig())
    pillar = 1.2 - np.sqrt(np.maximum(0.2**2 - (1.2 * np.sin(finder.bearings_rad)) ** 2, 0.0))
    ranges = np.where(np.abs(finder.bearings_rad) < 0.12, pillar, np.inf)
    scan = Scan(finder.bearings_rad, ranges, SIGMA_M, 4.0, 0.0)
    segments = extract(scan, ExtractionConfig())
    assert len(segments)
    assert not RangeBias().seen(scan, segments, 0.0).any()


def way(rng, scale, seen, steps=200, slip=0.014):
    """Wheels that slip, and poses that lie where scans of a scale put them, or where the wheels do."""
    found, pose, before = RangeScale(CONFIG), np.zeros(3), np.zeros(2)
    cov = np.diag([1e-6, 1e-6, 1e-8])
    for _ in range(steps):
        found.see(pose, cov)
        motion = np.array([0.12, 0.0, rng.uniform(-0.15, 0.15)])
        slipped = np.sqrt(0.12) * slip * rng.standard_normal(2)
        odometry = Odometry(motion, np.diag([0.12 * slip**2, 0.12 * slip**2, 1e-4]))
        found.move(odometry, pose[2])
        before = before + rotation(pose[2]) @ (motion[:2] + slipped)
        if seen:
            pose = np.append(scale * before + 0.003 * rng.standard_normal(2), pose[2] + motion[2])
        else:
            pose = compose(pose, motion)
            cov = cov + np.diag([0.12 * slip**2, 0.12 * slip**2, 0.0])
    return found


@pytest.mark.parametrize("scale", [0.98, 1.0, 1.02])
def test_a_scale_is_told_within_its_sigma(scale):
    off = []
    for seed in range(8):
        found = way(np.random.default_rng(seed), scale, seen=True)
        assert 0.002 < found.sigma < 0.005
        off.append((found.mean - scale) / found.sigma)
    assert np.max(np.abs(off)) < 3.5
    assert abs(np.mean(off)) < 1.2


def test_where_no_wall_holds_the_pose_nothing_is_told():
    assert way(np.random.default_rng(3), 1.0, seen=False).sigma == pytest.approx(CONFIG.scale, rel=0.1)


def test_scans_that_tell_the_motion_tell_no_scale():
    found = RangeScale(CONFIG)
    for k in range(100):
        found.see(np.array([0.15 * k, 0.0, 0.0]), np.diag([1e-6, 1e-6, 1e-8]))
        found.move(Odometry(np.array([0.14, 0.0, 0.0]), 1e-6 * np.eye(3), by_scans=True), 0.0)
    assert (found.mean, found.sigma) == (1.0, CONFIG.scale)


START, P0 = np.array([1.0, -2.0, 0.3]), np.diag([0.01, 0.02, 0.003]) ** 2
LINES = np.array([[0.2, 2.0], [1.8, 1.4], [-2.0, 2.5]])
COV = np.tile(np.diag([0.01, 0.005]) ** 2, (3, 1, 1))


def drive(backend, rng, taken=None, errors=None):
    """A short drive among three walls; `errors` become known halfway."""
    ids = backend.grow(LINES, COV, LINES[:, 1:] * np.column_stack([np.cos(LINES[:, 0]), np.sin(LINES[:, 0])]))
    for k in range(6):
        if errors is not None and k == 3:
            taken.errors = errors
        backend.predict(Odometry(np.array([0.1, 0.0, 0.05]), np.diag([0.01, 0.005, 0.01]) ** 2))
        pose = backend.belief.pose_world
        means, anchors = backend.belief.means, backend.belief.anchors
        n = np.column_stack([np.cos(means[:, 0]), np.sin(means[:, 0])])
        r = means[:, 1] + np.sum(n * (anchors - pose[:2]), axis=1)
        seen = np.column_stack([wrap(means[:, 0] - pose[2]), r]) + 0.004 * rng.standard_normal((3, 2))
        backend.update(Observations(ids, seen, COV), Observations(ids, seen, COV))
    return ids


@pytest.mark.parametrize("name", ["full-ekf", "invariant-ekf", "graph", "block-ekf"])
def test_errors_that_are_known_from_the_start_change_no_estimate(name):
    plain = BACKENDS[name].make(START.copy(), P0.copy())
    within = CalibratedBackend(BACKENDS[name].make(START.copy(), P0.copy()))
    within.taken.errors = RangeErrors(0.02, 0.0, 1.01, 0.0)
    ids = drive(plain, np.random.default_rng(4))
    drive(within, np.random.default_rng(4))
    one, other = plain.belief.joint(ids), within.belief.joint(ids)
    np.testing.assert_allclose(other.mean[:3], one.mean[:3], atol=2e-4)
    np.testing.assert_allclose(within.belief.lines_world, plain.belief.lines_world, atol=5e-4)
    np.testing.assert_allclose(np.diag(other.cov), np.diag(one.cov), rtol=0.05)


def test_what_is_unsure_of_errors_is_stated_as_their_derivative():
    backend = CalibratedBackend(BACKENDS["full-ekf"].make(START.copy(), P0.copy()))
    ids = drive(backend, np.random.default_rng(4))

    def lines(x):
        backend.taken.errors = RangeErrors(x[0], 0.0, x[1], 0.0)
        belief = backend.belief
        return np.concatenate([belief.pose_world[:2], belief.lines_world[:, 1]])

    here = np.array([0.01, 1.02])
    J = np.column_stack([(lines(here + d) - lines(here - d)) / 2e-6 for d in 1e-6 * np.eye(2)])
    backend.taken.errors = RangeErrors(0.01, 0.004, 1.02, 0.005)
    belief = backend.unsure(backend.belief)
    added = belief.joint(ids).cov - backend.belief.joint(ids).cov
    # The lines' own d about their anchors, which the scale moves as well: about the start both are one.
    means, start = belief.means, START[:2]
    n = np.column_stack([np.cos(means[:, 0]), np.sin(means[:, 0])])
    assert np.all(np.abs(J[2:, 0] + 1.0 / 1.02) < 1e-4)
    np.testing.assert_allclose(J[2:, 1], -(belief.lines_world[:, 1] - n @ start) / 1.02, rtol=1e-3, atol=1e-3)
    rows = [0, 1, 4, 6, 8]
    np.testing.assert_allclose(added[np.ix_(rows, rows)], J @ np.diag([0.004, 0.005]) ** 2 @ J.T, rtol=2e-3, atol=1e-9)
    np.testing.assert_allclose(belief.pose_cov, belief.joint(ids).cov[:3, :3], atol=1e-12)


def test_a_calibrated_scan_has_neither_bias_nor_scale():
    robot = RobotSpec(lidar=LidarSpec(calibrate=True))
    backend = CalibratedBackend(BACKENDS["full-ekf"].make(START.copy(), P0.copy()))
    ranges = Ranges(backend, robot, CONFIG, lambda scan: extract(scan, ExtractionConfig()))
    for scan in scans(np.random.default_rng(6), bias_m=0.03):
        heard = ranges.hear(scan)
        segments = extract(heard.scan, ExtractionConfig())
        ranges.learn(heard, segments, np.arange(len(segments)))
    assert heard.bias_m == pytest.approx(0.03, abs=0.003)
    np.testing.assert_allclose(scan.ranges_m - heard.scan.ranges_m, heard.bias_m, atol=1e-12)
    assert ranges.errors.is_biased()


def test_what_is_only_told_is_found_also_where_it_cuts_walls():
    """Each bowed wall is cut: what the pieces tell is little, and straight ones tell all."""
    backend = BACKENDS["full-ekf"].make(START.copy(), P0.copy())
    ranges = Ranges(backend, RobotSpec(), CONFIG, lambda scan: extract(scan, ExtractionConfig()))
    for scan in scans(np.random.default_rng(7), bias_m=0.05, beams=360):
        heard = ranges.hear(scan)
        assert heard.scan is scan
        segments = extract(scan, ExtractionConfig())
        ranges.learn(heard, segments, np.arange(len(segments)))
    assert ranges.errors.bias_m == pytest.approx(0.05, abs=0.005)


def test_words_are_said_beyond_three_sigmas_and_three_millimetres():
    assert RangeErrors(0.02, 0.001).is_biased()
    assert not RangeErrors(0.02, 0.01).is_biased()
    assert not RangeErrors(0.002, 0.0001).is_biased()
    assert RangeErrors(0.0, 0.001, 0.99, 0.002).is_scaled()
    assert not RangeErrors(0.0, 0.001, 1.01, 0.005).is_scaled()
    assert not RangeErrors(0.0, 0.001, 1.0005, 0.0001).is_scaled()


def test_what_the_bias_leaves_unknown_is_stated_in_full_by_every_scan():
    """Its error is common to all of them: stated once, ten scans would seem to leave a tenth of its variance."""
    some = list(scans(np.random.default_rng(8)))[:10]
    bias, last = told(some), some[-1]
    segments = extract(last, ExtractionConfig())
    added = bias.stated(last, segments).cov - segments.cov
    turned = bows(
        last.bearings_rad, last.ranges_m, last.sigmas_m.copy(), segments.lines, segments.beams, 4.0
    )[:, 2:] - [0.0, 1.0]  # fmt: skip
    np.testing.assert_allclose(added, 10 * bias.sigma_m**2 * turned[:, :, None] * turned[:, None, :], atol=1e-15)
