"""Beams through a gap, against shapely's crossings, and what a passed gap means for chains."""

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.gaps import passing
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
