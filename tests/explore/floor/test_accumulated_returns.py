"""Returns of the last scans: kept in the robot's frame, and their mean where they are of one place."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from chainslam.explore.floor.accumulated_returns import NEAR_BEYOND_M, SCANS, AccumulatedReturns, returns, steadied
from chainslam.slam.geometry.poses import compose, to_world
from chainslam.slam.robot import Odometry, Scan
from tests.explore.following.test_driving import AT_AXLE, between, scan_of


@given(st.integers(0, 2**32))
def test_what_was_hit_before_is_kept_in_the_robots_frame(seed):
    rng = np.random.default_rng(seed)
    recent = AccumulatedReturns()
    ranges = np.full(180, np.inf)
    at = rng.choice(180, 5, replace=False)
    ranges[at] = rng.uniform(0.2, 0.8, 5)
    scan = scan_of(ranges)
    seen = returns(scan, AT_AXLE)[np.hypot(*returns(scan, AT_AXLE).T) < 0.2 + NEAR_BEYOND_M]
    recent.see(scan)
    pose = np.zeros(3)
    for motion in rng.uniform(-0.2, 0.2, (3, 3)):
        recent.move(Odometry(motion, np.zeros((3, 3))))
        pose = compose(pose, motion)
    np.testing.assert_allclose(to_world(recent.points_robot, pose), seen, atol=1e-12)
    for _ in range(SCANS):
        recent.see(scan_of(np.full(180, np.inf)))
    assert not len(recent.points_robot)


def test_between_two_walls_the_mean_of_five_scans_is_nearer_to_the_truth_than_one():
    rng = np.random.default_rng(4)
    widths = []
    for _ in range(40):
        recent = AccumulatedReturns()
        for _ in range(SCANS):
            recent.see(between(0.45, rng))
        scan = between(0.45, rng)
        points = returns(scan, AT_AXLE)
        widths.append(
            [seen[seen[:, 1] > 0, 1].min() - seen[seen[:, 1] < 0, 1].max()]
            for seen in (points, steadied(scan, recent.points_robot))
        )
    raw, steady = (np.array(width) for width in zip(*widths, strict=True))
    assert raw.mean() < 0.425, "so that a door of 0.45 m seems too narrow"
    assert 0.43 < steady.mean() < 0.45
    assert np.mean((steady - 0.45) ** 2) < 0.5 * np.mean((raw - 0.45) ** 2)


def test_what_is_steadied_keeps_its_bearing_and_what_no_scan_before_saw_there_its_distance():
    ranges = np.full(180, np.nan)
    ranges[[90, 135, 45]] = 0.3, 0.4, 1.5
    scan = Scan(np.linspace(-np.pi, np.pi, 180, endpoint=False), ranges, 0.01, 4.0, 0.0)
    points = returns(scan, AT_AXLE)
    np.testing.assert_allclose(points, [[0.0, -1.5], [0.3, 0.0], [0.0, 0.4]], atol=1e-9)
    recent = np.array([[0.32, 0.001], [0.28, 0.0], [0.0, 0.5], [0.0, -1.6]])
    np.testing.assert_allclose(steadied(scan, recent), np.vstack([points, recent[2:]]), atol=1e-5)
    np.testing.assert_allclose(steadied(scan, recent[:1])[1], [0.31, 0.0], atol=1e-5)
    np.testing.assert_array_equal(steadied(scan, np.zeros((0, 2))), points)


def test_what_is_one_place_to_two_scans_follows_from_the_beams_and_their_noise():
    fine, rough = (
        Scan(np.linspace(-0.5, 0.5, k), np.where(np.arange(k) == k // 2, 0.3, np.nan), sigma, 4.0, 0.0)
        for k, sigma in ((1001, 0.002), (11, 0.03))
    )
    beside, beyond = np.array([[0.3, 0.003]]), np.array([[0.35, 0.0]])
    for recent in (beside, beyond):
        np.testing.assert_array_equal(steadied(fine, recent), np.vstack([returns(fine, AT_AXLE), recent]))
        assert not np.array_equal(steadied(rough, recent)[:1], returns(rough, AT_AXLE)) or recent is beside
    np.testing.assert_allclose(steadied(rough, beyond), [[0.325, 0.0]], atol=1e-9)
