"""Faces of which a scan shows three or four beams: the last one may be of the next face, and counts less."""

import numpy as np
import pytest
from scipy.optimize import least_squares

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.robot import Scan

SIGMA = 0.01


@pytest.mark.parametrize("share", [0.1, 0.5, 1.0])
def test_the_last_of_few_beams_counts_its_share(share):
    """Four beams on a free-standing face, against weighted least squares of their ranges."""
    bearings = 0.3 + np.deg2rad(2.0) * np.arange(4)
    ranges = 3.0 / np.cos(bearings) + SIGMA * np.array([0.8, -0.5, 1.1, -0.9])
    weights = np.sqrt([share, 1.0, 1.0, share])

    def residuals(line):
        return weights * (line[1] / np.cos(bearings - line[0]) - ranges) / SIGMA

    fit = least_squares(residuals, [0.0, 3.0], x_scale=[0.01, 0.01], xtol=1e-14, ftol=1e-14)
    found = extract(Scan(bearings, ranges, SIGMA, 6.0, 0.0), ExtractionConfig(end_share=share))
    assert found.beam_counts.tolist() == [4]
    assert (np.abs(found.lines[0] - fit.x) < 0.01 * np.sqrt(found.cov[0].diagonal())).all()
    np.testing.assert_allclose(found.cov[0], np.linalg.inv(fit.jac.T @ fit.jac), rtol=0.01)
    assert found.chi2[0] == pytest.approx(np.sum((residuals(fit.x) / weights) ** 2), rel=0.01)


def test_a_last_beam_of_the_next_face_leaves_an_exact_line_of_few_beams_nearer_to_what_it_states():
    """A face of 0.35 m whose end turns back by 40 degrees, from 3 to 4 m: the beam beyond is off by less than noise."""
    rng = np.random.default_rng(5)
    faces = np.array([[[0.35, 0.0], [0.0, 0.0]], [[0.6, 0.2], [0.35, 0.0]]])
    finder, values = RangeFinder(faces, LidarConfig()), {0.1: [], 1.0: []}
    for _ in range(400):
        pose = np.array([rng.uniform(-0.8, 0.8), -rng.uniform(3.0, 3.9), rng.uniform(-np.pi, np.pi)])
        ranges, hit = finder.cast(pose)
        true = np.array([0.5 * np.pi - pose[2], -pose[1]])
        for share, squared in values.items():
            found = extract(Scan(finder.bearings_rad, ranges, SIGMA, 4.0, 0.0), ExtractionConfig(end_share=share))
            for k, (first, last) in enumerate(found.beams):
                on = hit[np.arange(first, last + 1 + 180 * (last < first)) % 180]
                if found.is_tentative[k] and 0 < np.count_nonzero(on == 1) < np.count_nonzero(on == 0):
                    error = found.lines[k] - true
                    error[0] = wrap(error[0])
                    squared.append(error @ np.linalg.solve(found.cov[k], error))
    assert min(map(len, values.values())) > 50
    assert np.mean(values[0.1]) < 0.4 * np.mean(values[1.0])
