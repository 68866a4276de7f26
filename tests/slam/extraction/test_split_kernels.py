"""Breaks, the seam, and the division of a scan into pieces, against slow truths that fit each run by itself."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import beams_of_scan, extract, rules_of
from chainslam.slam.extraction.kernels.line_kernels import prefix_sums
from chainslam.slam.extraction.kernels.returns_kernels import positions_of, returns_of, rolled
from chainslam.slam.extraction.kernels.split_kernels import SEAM_BEAMS, cut_at, seam, split
from chainslam.slam.robot import Scan
from tests.slam.extraction.test_extract import room_scan

SIGMA = 0.01
CONFIG = ExtractionConfig()
RULES = rules_of(CONFIG)
seeds = st.integers(0, 2**32)


class Beams:
    """Noisy returns of a few walls, with the chi-square of any run of them by least squares."""

    def __init__(self, seed, count=24):
        rng = np.random.default_rng(seed)
        self.theta = np.linspace(-0.6, 0.6, count)
        self.rho = np.empty(count)
        corners = np.sort(rng.choice(np.arange(1, count), 2, replace=False))
        for wall in np.split(np.arange(count), corners):
            self.rho[wall] = rng.uniform(1.0, 2.0) / np.cos(self.theta[wall] - rng.uniform(-0.5, 0.5))
        self.rho += SIGMA * rng.standard_normal(count)
        self.sums = prefix_sums(np.cos(self.theta), np.sin(self.theta), self.rho, np.full(count, SIGMA))

    def chi2(self, start, stop):
        if stop - start <= 2:
            return 0.0
        run = slice(start, stop)
        rows = np.column_stack([np.cos(self.theta[run]), np.sin(self.theta[run])]) * (self.rho[run, None] ** 2 / SIGMA)
        solution, *_ = np.linalg.lstsq(rows, self.rho[run] / SIGMA)
        return float(np.sum((rows @ solution - self.rho[run] / SIGMA) ** 2))


@given(seed=seeds, full=st.booleans())
@settings(max_examples=100, deadline=None)
def test_a_surface_breaks_off_where_no_wall_has_two_such_ranges(seed, full):
    rng = np.random.default_rng(seed)
    count = int(rng.integers(8, 40))
    bearings = np.linspace(-np.pi, np.pi, count, endpoint=False) if full else np.linspace(-1.0, 1.0, count)
    ranges = np.where(rng.random(count) < 0.2, np.inf, rng.uniform(1.0, 1.0 + rng.choice([0.05, 3.0]), count))
    returns = returns_of(*beams_of_scan(Scan(bearings, ranges, SIGMA, 4.0, 0.0)), RULES)
    seen = np.flatnonzero(np.isfinite(ranges)).tolist()
    step, broken = bearings[1] - bearings[0], []
    for before, after in zip([seen[-1], *seen], seen, strict=False):
        gap = after - before if after > before else after + count - before
        near, far = sorted([ranges[before], ranges[after]])
        # Of all walls that pass through the nearer return at this incidence or a steeper one, the farthest point.
        farthest = near * np.sin(CONFIG.grazing_rad + gap * step) / np.sin(CONFIG.grazing_rad)
        is_seam = not full and after <= before
        broken.append(is_seam or gap > CONFIG.gap_beams or far - farthest > CONFIG.shared.noise_sigmas * SIGMA)
    assert returns.is_ring == (not any(broken))
    found = {int(returns.beam[at]) for at in returns.breaks[:-1]} if not returns.is_ring else set()
    assert found == {seen[i] for i in range(len(seen)) if broken[i]}
    assert returns.breaks[0] == 0
    assert returns.breaks[-1] == len(seen)
    assert sorted(returns.beam.tolist()) == seen
    assert np.all(np.diff(returns.turn) > 0)
    np.testing.assert_array_equal(returns.turn % count, returns.beam)
    np.testing.assert_array_equal(returns.ranges_m, ranges[returns.beam])
    np.testing.assert_allclose(np.arctan2(returns.sin, returns.cos), np.angle(np.exp(1j * bearings[returns.beam])))


@given(seed=seeds, by=st.integers(0, 30))
@settings(max_examples=50, deadline=None)
def test_a_bearing_comes_after_the_returns_before_it_wherever_the_ring_begins(seed, by):
    rng = np.random.default_rng(seed)
    bearings = np.linspace(-np.pi, np.pi, 36, endpoint=False)
    returns = returns_of(*beams_of_scan(Scan(bearings, np.full(36, 2.0), SIGMA, 4.0, 0.0)), RULES)
    returns = rolled(returns, by)
    asked = rng.uniform(-7.0, 7.0, 5)
    first = bearings[returns.beam[0]]
    for bearing, at in zip(asked, positions_of(asked, bearings[0], returns), strict=True):
        assert at == np.sum(np.mod(bearings[returns.beam] - first, 2 * np.pi) < np.mod(bearing - first, 2 * np.pi))


@given(seed=seeds, middle=st.integers(1, 23))
@settings(max_examples=30, deadline=None)
def test_the_seam_lies_where_two_lines_save_most_over_one_within_an_unbroken_run(seed, middle):
    beams, breaks = Beams(seed), np.array([0, middle, 24])
    saved = {}
    for low, high in itertools.pairwise(breaks.tolist()):
        for at in range(low + 1, high):
            start, stop = max(at - SEAM_BEAMS, low), min(at + SEAM_BEAMS, high)
            saved[at] = beams.chi2(start, stop) - beams.chi2(start, at) - beams.chi2(at, stop)
    assert saved[seam(beams.sums, breaks)] == pytest.approx(max(saved.values()), rel=1e-4, abs=1e-3)


@given(seed=seeds, inner=st.integers(0, 3))
@settings(max_examples=60, deadline=None)
def test_the_pieces_are_the_cheapest_of_all_divisions(seed, inner):
    beams, rng = Beams(seed), np.random.default_rng(seed)
    breaks = np.array([0, *sorted(rng.choice(np.arange(1, 24), inner, replace=False).tolist()), 24])
    pieces, loose = split(beams.sums, breaks, RULES).tolist(), CONFIG.shared.outlier_sigmas**2
    # The least cost up to each return, by trying every piece that ends there.
    least = [0.0]
    for stop in range(1, 25):
        first = max(at for at in breaks.tolist() if at < stop)
        runs = [(start, stop) for start in range(first, stop - CONFIG.least_beams + 1)]
        with_piece = [least[start] + beams.chi2(start, stop) + CONFIG.segment_cost for start, _ in runs]
        least.append(min([least[-1] + loose, *with_piece]))
    covered = sum(stop - start for start, stop in pieces)
    price = sum(beams.chi2(*run) + CONFIG.segment_cost for run in pieces) + loose * (24 - covered)
    assert price == pytest.approx(least[-1], rel=1e-5)
    assert all(stop - start >= CONFIG.least_beams for start, stop in pieces)
    assert all(one[1] <= other[0] for one, other in itertools.pairwise(pieces))
    assert not any(start < at < stop for start, stop in pieces for at in breaks.tolist())


@given(seed=seeds)
@settings(max_examples=100, deadline=None)
def test_pieces_are_cut_where_two_lines_fit_best_and_parts_that_are_too_short_stay_loose(seed):
    beams, rng, least = Beams(seed), np.random.default_rng(seed), CONFIG.least_beams
    marks = np.sort(rng.choice(25, 4, replace=False)).tolist()
    pieces = [(a, b) for a, b in zip(marks[::2], marks[1::2], strict=True) if b - a >= least]
    at, expected = rng.integers(0, 25, 3), []
    for start, stop in pieces:
        inner = sorted(int(x) for x in at if start < x < stop)
        for mark, end in itertools.pairwise([*inner, stop]):
            allowed = range(start + least, end - least + 1) if min(mark - start, end - mark) >= least else []
            cut = min(allowed, key=lambda k: beams.chi2(start, k) + beams.chi2(k, end), default=mark)
            expected += [[start, cut]] if cut - start >= least else []
            start = max(start, cut)
        expected += [[start, stop]] if stop - start >= least else []
    assert cut_at(np.array(pieces, dtype=np.int64).reshape(-1, 2), beams.sums, at, RULES).tolist() == expected


def test_a_cut_that_leaves_nothing_leaves_no_segment():
    scan = Scan(np.linspace(-0.1, 0.1, 5), np.full(5, 2.0), SIGMA, 4.0, 0.0)
    assert len(extract(scan)) == 1
    assert len(extract(scan, vertices_rad=scan.bearings_rad[1:4] - 0.01)) == 0


@given(seed=seeds)
@settings(max_examples=30, deadline=None)
def test_arrays_of_any_kind_give_the_same_segments(seed):
    scan = room_scan(seed)
    ranges = np.repeat(scan.ranges_m, 2)[::2]
    ranges.flags.writeable = False
    here, there = vars(extract(scan)), vars(extract(replace(scan, ranges_m=ranges)))
    for name, found in here.items():
        np.testing.assert_array_equal(found, there[name])
