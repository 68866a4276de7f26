"""Range noise is told by the scatter of beams about their lines, whatever it was taken for."""

import numpy as np
import pytest
import shapely

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.range_noise import range_noise
from chainslam.slam.robot import Scan
from tests.slam.association.drives import faces_of

RULES = ExtractionConfig()
ROOM = shapely.box(0, 0, 7, 5).difference(shapely.box(3, 2.2, 4, 2.8)).difference(shapely.box(6, 4, 7, 5))


NOISES = [(0.004, 0.02), (0.01, 0.02), (0.02, 0.02), (0.03, 0.02), (0.01, 0.01)]
"""What it is and what it was taken for, m."""


@pytest.mark.parametrize(("true_m", "assumed_m"), NOISES)
def test_noise_is_found_from_half_to_five_times_what_it_was_taken_for(true_m, assumed_m):
    finder, rng = RangeFinder(faces_of(ROOM), LidarConfig(beams=360, range_max_m=8.0)), np.random.default_rng(5)
    poses = np.column_stack([rng.uniform(0.5, 2.5, 40), rng.uniform(0.5, 4.5, 40), rng.uniform(-3, 3, 40)])
    found = []
    for pose in poses:
        ranges = finder.cast(pose)[0] + true_m * rng.standard_normal(360)
        found.append(extract(Scan(finder.bearings_rad, ranges, assumed_m, 8.0, 0.0), RULES))
    assert range_noise(found, assumed_m, 6) == pytest.approx(true_m, rel=0.1)
    assert range_noise(found, assumed_m, 400) is None
