"""Breaks, the cheapest division and its surest cut, against slow truths that fit each run by itself."""

import itertools
from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import beams_of_scan, extract, rules_of
from chainslam.slam.extraction.kernels.line_kernels import prefix_sums
from chainslam.slam.extraction.kernels.returns_kernels import returns_of
from chainslam.slam.extraction.kernels.split_kernels import split, surest
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


@given(seed=seeds, count=st.integers(0, 24), runs=st.integers(1, 3), given_rules=st.booleans())
@settings(max_examples=200, deadline=None)
def test_no_division_is_cheaper(seed, count, runs, given_rules):
    """Nor with rules by which one long piece may cost less than loose beams until a second one is long enough."""
    beams, rng = Beams(seed), np.random.default_rng(seed)
    cost, fewest, sigmas = rng.uniform(0.0, 20.0), int(rng.integers(3, 9)), rng.uniform(0.5, 6.0)
    rules = RULES if given_rules else RULES._replace(segment_cost=cost, least_beams=fewest, outlier_sigmas=sigmas)
    breaks = np.unique([0, *rng.integers(0, count + 1, runs - 1), count])
    pieces = split(beams.sums[: count + 1], breaks, rules).tolist()
    least = [0.0]
    for stop in range(1, count + 1):
        run = max(at for at in breaks if at < stop)
        ways = (
            least[start] + beams.chi2(start, stop) + rules.segment_cost
            for start in range(run, stop - rules.least_beams + 1)
        )
        least.append(min(least[-1] + rules.outlier_sigmas**2, *ways, np.inf))
    assert all(one[1] <= other[0] for one, other in itertools.pairwise(pieces))
    assert all(stop - start >= rules.least_beams for start, stop in pieces)
    assert not any(start < at < stop for start, stop in pieces for at in breaks)
    loose = count - sum(stop - start for start, stop in pieces)
    price = sum(beams.chi2(*piece) + rules.segment_cost for piece in pieces) + rules.outlier_sigmas**2 * loose
    assert price == pytest.approx(least[count], rel=1e-4, abs=1e-3)


@given(seed=seeds)
@settings(max_examples=50, deadline=None)
def test_the_surest_cut_is_that_at_which_two_lines_save_most(seed):
    beams = Beams(seed)
    pieces = [[0, 5], [5, 11], [12, 17], [17, 20], [20, 24]]
    saved = {
        one[1]: beams.chi2(one[0], other[1]) - beams.chi2(*one) - beams.chi2(*other)
        for one, other in itertools.pairwise(pieces)
        if one[1] == other[0]
    }
    found = surest(np.array(pieces), beams.sums)
    assert saved[found] == pytest.approx(max(saved.values()), rel=1e-4)
    assert surest(np.array(pieces[1:3]), beams.sums) == surest(np.array(pieces[:1]), beams.sums) == 0


@given(seed=seeds)
@settings(max_examples=30, deadline=None)
def test_arrays_of_any_kind_give_the_same_segments(seed):
    scan = room_scan(seed)
    ranges = np.repeat(scan.ranges_m, 2)[::2]
    ranges.flags.writeable = False
    here, there = vars(extract(scan)), vars(extract(replace(scan, ranges_m=ranges)))
    for name, found in here.items():
        np.testing.assert_array_equal(found, there[name])
