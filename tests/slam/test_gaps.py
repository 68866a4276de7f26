"""Beams through a gap, against shapely's crossings, and what a passed gap means for chains."""

from dataclasses import replace

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from sim.lidar import LidarConfig, RangeFinder
from slam.backends import BACKENDS
from slam.chains import HEAD, TAIL, connect
from slam.gaps import Gaps, passing
from slam.mapper import Mapper
from slam.robot import Scan

BEARINGS = np.deg2rad(np.arange(-180.0, 180.0, 2.0))


@settings(max_examples=60, deadline=None)
@given(st.integers(0, 10**6))
def test_passing_beams_are_those_that_shapely_sees_cross_the_middle_of_the_gap(seed: int) -> None:
    rng = np.random.default_rng(seed)
    pose = np.array([*rng.uniform(-1, 1, 2), rng.uniform(-np.pi, np.pi)])
    ends = rng.uniform(-2, 2, (5, 2, 2))
    ends = ends[np.hypot(*(ends[:, 1] - ends[:, 0]).T) > 3 * 0.04]
    ranges = np.where(rng.random(180) < 0.2, np.nan, rng.uniform(0.2, 4.0, 180))
    margin, beyond = 0.04, 0.15
    found = passing(ends[:, 0], ends[:, 1], pose, Scan(BEARINGS, ranges, 0.01, 4.0, 0.0), beyond, margin)
    for gap, row in zip(ends, found, strict=True):
        along = (gap[1] - gap[0]) / np.hypot(*(gap[1] - gap[0]))
        middle = shapely.LineString([gap[0] + margin * along, gap[1] - margin * along])
        for bearing, reach, passes in zip(BEARINGS, np.where(np.isnan(ranges), 4.0, ranges), row, strict=True):
            ahead = np.array([np.cos(pose[2] + bearing), np.sin(pose[2] + bearing)])
            beam = shapely.LineString([pose[:2], pose[:2] + max(reach - beyond, 0.0) * ahead])
            if abs(beam.distance(middle)) < 1e-9 or beam.distance(middle) > 1e-6:
                assert passes == beam.intersects(middle)


def before_a_gap() -> tuple[Mapper, Scan, np.ndarray]:
    """Return a mapper where two walls end 0.21 m from each other, at a corner that beams go through, and a scan."""
    faces = np.array([[[0.0, 0.0], [3.0, 0.0]], [[3.15, 0.15], [3.15, 3.0]]])
    finder, pose = RangeFinder(faces, LidarConfig()), np.array([2.5, 0.8, 0.0])
    mapper = Mapper(BACKENDS["full-ekf"].make(pose.copy(), 1e-6 * np.eye(3)))
    return mapper, Scan(finder.bearings_rad, finder.cast(pose)[0], 0.01, 4.0, 0.0), pose


@pytest.mark.parametrize(("through", "is_passed"), [(1, False), (2, True)])
def test_a_gap_is_passed_by_two_beams_of_one_scan(through: int, is_passed: bool) -> None:
    """All others end in it: a lone one may be a fault."""
    mapper, scan, pose = before_a_gap()
    walls = [mapper.step(scan).map for _ in range(3)][-1]
    ends = walls.ends_world[np.argsort(walls.belief.means[:, 0])]
    (beams,) = np.nonzero(passing(ends[:1, HEAD], ends[1:, TAIL], pose, scan, 0.15, 0.04)[0])
    assert len(beams) > 2
    ranges = scan.ranges_m.copy()
    ranges[beams[through:]] = np.hypot(*(ends[0, HEAD] - pose[:2]))
    gaps = Gaps()
    gaps.see(walls, replace(scan, ranges_m=ranges))
    assert bool(gaps.passed) == is_passed


def test_a_gap_that_beams_passed_stays_open_though_both_its_ends_were_set_aside() -> None:
    mapper, scan, _ = before_a_gap()
    for _ in range(3):
        update = mapper.step(scan)
    along, across = update.map.ids[np.argsort(update.map.belief.means[:, 0])].tolist()
    aside = {(along, HEAD), (across, TAIL)}
    assert len(connect(update.map, aside)) == 1
    assert len(mapper.step(scan, aside).chains) == 2
