"""Breaks, candidates, the choice among them, and where cuts settle, against slow truths that fit each run by itself."""

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
from chainslam.slam.extraction.kernels.split_kernels import (
    bend_within,
    candidates,
    choose,
    settled,
    split_gains,
    surest,
)
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


@given(seed=seeds, middle=st.integers(6, 18))
@settings(max_examples=30, deadline=None)
def test_a_gain_is_what_two_lines_save_over_one_at_each_scale_within_the_unbroken_run(seed, middle):
    beams, breaks = Beams(seed), np.array([0, middle, 24])
    gains = split_gains(beams.sums, breaks, RULES)
    assert not gains[:, breaks].any()
    for k, at in itertools.product(range(len(CONFIG.scales)), range(1, 24)):
        if at != middle:
            low, high = (0, middle) if at < middle else (middle, 24)
            start, stop = max(at - CONFIG.scales[k], low), min(at + CONFIG.scales[k], high)
            saved = beams.chi2(start, stop) - beams.chi2(start, at) - beams.chi2(at, stop)
            assert gains[k, at] == pytest.approx(saved, rel=1e-4, abs=1e-3)
    assert gains[:, surest(gains)].max() == gains.max()


@given(seed=seeds)
@settings(max_examples=100, deadline=None)
def test_candidates_are_breaks_peaks_and_the_neighbours_of_sure_peaks(seed):
    rng = np.random.default_rng(seed)
    gains = np.round(rng.exponential(10.0, (3, 30)))
    gains[:, [0, 12, 29]] = 0.0
    expected = {0, 12, 29}
    for row in gains:
        for at in range(1, 29):
            if row[at] > CONFIG.candidate_gain and row[at] == row[at - 1 : at + 2].max():
                expected |= {at - 1, at, at + 1} if row[at] > CONFIG.sure_gain else {at}
    assert set(np.flatnonzero(candidates(gains, np.array([0, 12, 29]), RULES)).tolist()) == expected


@given(seed=seeds, inner=st.integers(1, 5))
@settings(max_examples=50, deadline=None)
def test_the_dynamic_program_finds_the_cheapest_of_all_divisions(seed, inner):
    beams, rng = Beams(seed), np.random.default_rng(seed)
    cuts = np.array([0, *sorted(rng.choice(np.arange(1, 24), inner, replace=False).tolist()), 24])
    breaks = np.array([0, cuts[rng.integers(1, len(cuts))], 24])
    breaks = np.unique(breaks)
    pieces = [tuple(piece) for piece in choose(beams.sums, cuts, breaks, RULES).tolist()]

    def price(segments):
        covered = sum(stop - start for start, stop in segments)
        return sum(beams.chi2(*run) + CONFIG.segment_cost for run in segments) + CONFIG.shared.outlier_sigmas**2 * (
            24 - covered
        )

    allowed = [
        (start, stop)
        for start, stop in itertools.combinations(cuts.tolist(), 2)
        if stop - start >= CONFIG.least_beams and not any(start < at < stop for at in breaks)
    ]
    assert set(pieces) <= set(allowed)
    divisions = (
        chosen
        for size in range(len(cuts))
        for chosen in itertools.combinations(allowed, size)
        if all(one[1] <= other[0] for one, other in itertools.pairwise(chosen))
    )
    assert price(pieces) == pytest.approx(min(map(price, divisions)), rel=1e-5)


@given(seed=seeds, start=st.integers(0, 10), size=st.integers(0, 13))
@settings(max_examples=50, deadline=None)
def test_a_bend_is_where_two_lines_save_most_and_more_than_a_segment_costs(seed, start, size):
    beams, stop = Beams(seed), start + size
    saved = {
        at: beams.chi2(start, stop) - beams.chi2(start, at) - beams.chi2(at, stop)
        for at in range(start + CONFIG.least_beams, stop - CONFIG.least_beams + 1)
    }
    found = bend_within(beams.sums, start, stop, RULES)
    if max(saved.values(), default=0.0) > CONFIG.segment_cost:
        assert saved[found] == pytest.approx(max(saved.values()), rel=1e-5)
    else:
        assert found == -1


@given(seed=seeds, broken=st.booleans())
@settings(max_examples=50, deadline=None)
def test_cuts_settle_where_their_two_lines_fit_best_all_at_once(seed, broken):
    beams, rng = Beams(seed), np.random.default_rng(seed)
    ends = [0, *(6 * np.arange(1, 4) + rng.integers(-2, 3, 3)).tolist(), 24]
    pieces = [list(piece) for piece in itertools.pairwise(ends)]
    breaks = np.array([0, ends[1], 24]) if broken else np.array([0, 24])
    found = settled(np.array(pieces), beams.sums, breaks, RULES)
    for _ in range(len(beams.sums)):
        moved = [piece.copy() for piece in pieces]
        for k, (one, other) in enumerate(itertools.pairwise(pieces)):
            if one[1] in breaks:
                continue
            spare = [(piece[1] - piece[0] - CONFIG.least_beams) // 2 for piece in (one, other)]
            tried = range(one[1] - spare[0], one[1] + spare[1] + 1)
            moved[k][1] = moved[k + 1][0] = min(tried, key=lambda at: beams.chi2(one[0], at) + beams.chi2(at, other[1]))
        pieces = moved
    assert found.tolist() == pieces


@given(seed=seeds)
@settings(max_examples=30, deadline=None)
def test_arrays_of_any_kind_give_the_same_segments(seed):
    scan = room_scan(seed)
    ranges = np.repeat(scan.ranges_m, 2)[::2]
    ranges.flags.writeable = False
    here, there = vars(extract(scan)), vars(extract(replace(scan, ranges_m=ranges)))
    for name, found in here.items():
        np.testing.assert_array_equal(found, there[name])
