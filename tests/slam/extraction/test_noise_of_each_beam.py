"""Beams that differ in noise: lines are as sure as stated, and a noisier stretch is not cut into pieces."""

import numpy as np
import pytest
from scipy.stats import chi2

from chainslam.sim.lidar import LidarConfig, RangeFinder, beam_sigmas, noisy
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import beams_of_scan, extract, rules_of
from chainslam.slam.extraction.kernels.returns_kernels import returns_of, rolled
from chainslam.slam.map.profiles import Profiles
from chainslam.slam.robot import Scan
from tests.slam.extraction.test_extract import CLOSED
from tests.slam.map.test_profiles import faces_of, look, random_poses

FAR = LidarConfig(beams=541, range_max_m=12.0, sigma_m=0.005, sigma_share=0.02)
WALL = np.array([[[-2.0, 0.0], [9.0, 0.0]]])
"""Free side on the left; from before it its ranges go from 1.5 to 9 m, their noise from 3 to 18 cm."""
POSE = np.array([0.0, 1.5, 0.0])
LINE = np.array([-np.pi / 2, 1.5])
DRAWS = 300


def scans(config=FAR, faces=WALL, pose=POSE, draws=DRAWS):
    """Yield scans of a wall whose noise grows with the range."""
    finder, rng = RangeFinder(faces, config), np.random.default_rng(5)
    ranges = finder.cast(pose)[0]
    for k in range(draws):
        measured = noisy(ranges, beam_sigmas(ranges, config), rng.standard_normal(len(ranges)), config.range_max_m)
        yield Scan(finder.bearings_rad, measured, config.sigma_m, config.range_max_m, 0.1 * k, config.sigma_share)


def test_lines_of_beams_that_differ_in_noise_are_as_sure_as_stated():
    nees, chi, counts, pieces = [], [], [], []
    for scan in scans():
        segments = extract(scan)
        longest = int(np.argmax(segments.beam_counts))
        off = segments.lines[longest] - LINE
        nees.append(off @ np.linalg.solve(segments.cov[longest], off))
        chi.append(segments.chi2[longest])
        counts.append(segments.beam_counts[longest])
        pieces.append(np.count_nonzero(~segments.is_tentative))
    low, high = chi2.ppf([0.0005, 0.9995], 2 * DRAWS) / DRAWS
    assert low < np.mean(nees) < high
    assert 0.9 < np.mean(chi) / np.mean(np.array(counts) - 2) < 1.1
    assert np.mean(pieces) < 1.1


def test_a_stretch_of_noisier_beams_is_no_break():
    """One wall; some beams are ten times as noisy as the others, and say so."""
    finder, rng = RangeFinder(np.array([[[2.0, -2.0], [2.0, 2.0]]]), LidarConfig()), np.random.default_rng(2)
    exact = finder.cast(np.zeros(3))[0]
    sigmas = np.where(np.arange(180) % 12 < 4, 0.05, 0.005)
    found = []
    for _ in range(100):
        measured = noisy(exact, sigmas, rng.standard_normal(180), 4.0)
        segments = extract(Scan(finder.bearings_rad, measured, sigmas, 4.0, 0.0))
        found.append(len(segments.lines))
    assert np.mean(found) < 1.05


def test_noise_that_grows_with_the_range_breaks_no_wall():
    config = LidarConfig(sigma_share=0.03)
    face = np.array([[[6.0, 0.0], [-6.0, 0.0]]])
    finder, rng = RangeFinder(face, config), np.random.default_rng(3)
    profiles, ends = Profiles(), np.array([[-6.0, 6.0]])
    for k, pose in enumerate(random_poses(rng, 400)):
        exact = finder.cast(pose)[0]
        measured = noisy(exact, beam_sigmas(exact, config), rng.standard_normal(180), config.range_max_m)
        scan = Scan(finder.bearings_rad, measured, config.sigma_m, config.range_max_m, 0.1 * k, config.sigma_share)
        segments = extract(scan)
        look(profiles, pose, scan, segments.take(~segments.is_tentative))
        assert faces_of(profiles, ends)[0] == 0.0


@pytest.mark.parametrize("seed", range(12))
def test_turned_or_mirrored_scans_give_turned_or_mirrored_lines(seed):
    """Each beam takes its noise with it, wherever the scan begins."""
    rng = np.random.default_rng(seed)
    finder = RangeFinder(CLOSED, LidarConfig())
    exact = finder.cast(np.array([*rng.uniform(0.6, 1.8, 2), 0.0]))[0]
    sigmas = np.where(rng.random(180) < 0.3, 0.08, 0.004)
    ranges = noisy(exact, sigmas, rng.standard_normal(180), 4.0)
    lines = extract(Scan(finder.bearings_rad, ranges, sigmas, 4.0, 0.0)).lines
    by = int(rng.integers(1, 180))
    turned = extract(Scan(finder.bearings_rad, np.roll(ranges, by), np.roll(sigmas, by), 4.0, 0.0)).lines
    pitch = finder.bearings_rad[1] - finder.bearings_rad[0]
    same(lines + np.array([by * pitch, 0.0]), turned)
    at = np.linspace(-3.0, 3.0, 180)
    ahead = Scan(at, ranges, sigmas, 4.0, 0.0)
    mirrored = Scan(at, ranges[::-1].copy(), sigmas[::-1].copy(), 4.0, 0.0)
    same(extract(ahead).lines * np.array([-1.0, 1.0]), extract(mirrored).lines)


def same(one, other):
    """Hold lines against lines, in any order and any turn."""
    assert len(one) == len(other)
    places = [
        np.column_stack([lines[:, 1] * np.cos(lines[:, 0]), lines[:, 1] * np.sin(lines[:, 0])])
        for lines in (one, other)
    ]
    apart = np.hypot(*(places[0][:, None] - places[1]).transpose(2, 0, 1))
    np.testing.assert_allclose(apart.min(axis=1), 0.0, atol=1e-9)


@pytest.mark.parametrize("before_noisy", [False, True])
@pytest.mark.parametrize("after_noisy", [False, True])
def test_a_step_is_a_break_only_beyond_the_noise_of_both_beams_beside_it(before_noisy, after_noisy):
    bearings = np.linspace(-0.5, 0.5, 41)
    ranges = np.where(np.arange(41) < 20, 2.0, 3.0) / np.cos(bearings)
    sigmas = np.full(41, 0.005)
    sigmas[19], sigmas[20] = 0.5 if before_noisy else 0.005, 0.5 if after_noisy else 0.005
    breaks = returns_of(*beams_of_scan(Scan(bearings, ranges, sigmas, 4.0, 0.0)), rules_of(ExtractionConfig())).breaks
    assert (20 in breaks) != (before_noisy or after_noisy)


@pytest.mark.parametrize("by", [1, 50, 179])
def test_the_returns_of_a_ring_keep_the_noise_of_their_beams_wherever_it_begins(by):
    rng = np.random.default_rng(by)
    finder = RangeFinder(CLOSED, LidarConfig())
    sigmas = rng.uniform(0.004, 0.02, 180)
    ranges = finder.cast(np.array([1.0, 1.0, 0.3]))[0]
    scan = Scan(finder.bearings_rad, ranges, sigmas, 4.0, 0.0)
    returns = returns_of(*beams_of_scan(scan), rules_of(ExtractionConfig()))
    assert returns.is_ring
    for one in (returns, rolled(returns, by)):
        np.testing.assert_array_equal(one.sigmas_m, sigmas[one.beam])


def test_beams_that_fell_short_by_chance_draw_no_wall_nearer():
    """The noise at the measured range would weigh them more: a bias of 2 share^2 r, against sigma over many scans."""
    config = LidarConfig(beams=541, range_max_m=10.0, sigma_m=0.001, sigma_share=0.03)
    lines = []
    for scan in scans(config, np.array([[[-2.0, 0.0], [2.0, 0.0]]]), np.array([0.0, 3.0, 0.0])):
        segments = extract(scan)
        lines.append(segments.lines[int(np.argmax(segments.beam_counts)), 1])
    off = np.array(lines) - 3.0
    assert abs(off.mean()) < 3.3 * off.std() / np.sqrt(DRAWS)
    assert 6.0 * off.std() / np.sqrt(DRAWS) < 2 * 0.03**2 * 3.0
