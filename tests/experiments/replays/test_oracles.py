"""What the truth takes the place of, and what a mapper then need not allow for."""

import numpy as np

from chainslam.experiments.replays.oracles import PerfectExtraction, Witness, of_true_lines
from chainslam.experiments.scoring.truth import truth_of
from chainslam.sim.chance import Chance
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.sim.robot import RobotConfig
from chainslam.slam.config import MapperConfig
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.map.reliability import Reliability
from chainslam.slam.robot import Scan


def test_walls_of_true_lines_lie_on_them_however_short_they_are():
    """A wall of 0.1 m may else be of two faces."""
    ids, extents = np.array([0]), np.array([[0.0, 0.1]])
    told = []
    for config in (MapperConfig(), of_true_lines(MapperConfig())):
        reliability = Reliability(config.walls.reliability)
        reliability._records.rows(ids)  # the wall begins
        told.append(reliability.off_line_cov(extents, np.zeros((1, 5)))[1])
    usual, true = told
    assert usual[0, 0, 0] > 0.0
    np.testing.assert_array_equal(true, np.zeros((1, 2, 2)))


def middles_rad(segments):
    """Where the middle of each seen piece is, as its line and its covariance have it."""
    return segments.lines[:, 0] + np.arctan2(segments.cov[:, 0, 1] / segments.cov[:, 0, 0], segments.lines[:, 1])


def test_a_piece_whose_line_is_true_stays_on_the_beams_that_showed_it(world):
    truth, pose = truth_of(world, RobotConfig()), np.array([0.4, 0.3, 0.2])
    finder = RangeFinder(truth.faces, LidarConfig())
    ranges, faces = finder.cast(pose)[:2]
    noisy = ranges + 0.01 * np.random.default_rng(1).standard_normal(len(ranges))
    scan = Scan(finder.bearings_rad, noisy, 0.01, 4.0, 0.0)
    seen = extract(scan, ExtractionConfig())
    witness = Witness(truth, pose[None], np.asarray(faces)[None])
    drawn = PerfectExtraction(witness, Chance(3, 0))(scan, ExtractionConfig())
    assert len(drawn) == len(seen) >= 2
    assert np.abs(drawn.lines - seen.lines).max() > 1e-4
    np.testing.assert_allclose(np.cos(middles_rad(drawn) - middles_rad(seen)), 1.0, atol=1e-9)
