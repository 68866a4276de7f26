"""Cost of telling one motion by its scans, for scanners of 180 and of 1,081 beams."""

import itertools
from collections.abc import Iterator

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from benchmarks.test_lidar import rooms, walk
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.odometry.scan_matching import ScanMatcher
from chainslam.slam.robot import Odometry, Scan


@pytest.mark.parametrize("beams", [180, 1081])
def test_one_match(benchmark: BenchmarkFixture, beams: int) -> None:
    """A walk to and fro through rooms, by wheels that report 0.03 m and 2 degrees too much; the target is 3 ms."""
    finder, poses = RangeFinder(rooms(200), LidarConfig(beams=beams)), walk(40, 12.0)
    poses[:, 2] *= 0.2
    around = itertools.cycle(np.concatenate([poses, poses[::-1]]))
    rng, matcher = np.random.default_rng(0), ScanMatcher()

    def scan(pose: np.ndarray) -> Scan:
        ranges = finder.cast(pose)[0] + 0.01 * rng.standard_normal(beams)
        return Scan(finder.bearings_rad, np.where(ranges < 4.0, ranges, np.inf), 0.01, 4.0, 0.0)

    def places() -> Iterator[tuple[Scan, Odometry]]:
        for before, after in itertools.pairwise(around):
            motion = compose(inverse(before), after) + np.array([0.03, 0.0, 0.035])
            yield scan(after), Odometry(motion, np.diag([0.03, 0.03, 0.05]) ** 2)

    drive = places()
    matcher.begin(scan(poses[0]))
    benchmark.pedantic(matcher.match, setup=lambda: (next(drive), {}), rounds=200, warmup_rounds=25)
