"""Intervals and tests over runs, not steps; and over buildings, for statements about other buildings.

By run: a studentised bootstrap of whole runs within each building (Efron and Tibshirani, An Introduction to the
Bootstrap, 1993, section 12.5). By building: Student's t over the buildings' means. Both hold their level with ten
skewed values (`studies.results.levels`); with fewer than five values there is no interval.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from scipy.special import stdtr, stdtrit

Clustered = Mapping[tuple[str, int], float]
"""A value for each run, named by (building, seed)."""
DRAWS = 4000
LEVEL = 0.95
LEAST = 5
"""Below this number of runs or buildings there is no interval."""
FEW_RUNS = 10
"""No conclusion is drawn from fewer runs, even though an interval is computed."""


@dataclass(frozen=True)
class Estimate:
    """A mean over runs with its 95 % intervals."""

    mean: float
    low: float | None
    high: float | None
    """By run: for these very buildings, other runs; None for fewer than five, or where a building has only one."""
    low_buildings: float | None
    high_buildings: float | None
    """By building: for other buildings; None where there are fewer than five."""
    runs: int
    effect_size: float | None
    """Mean over standard deviation between runs (Cohen's d_z where the values are paired differences)."""
    p: float | None
    """Chance of a mean so far from zero, two-sided, by t: over buildings where there are five, else over runs."""


def estimate(values: Clustered, seed: int = 0) -> Estimate | None:
    """Return the mean of a value over runs with its intervals; None where there is no run."""
    if not values:
        return None
    groups = _by_building(values)
    every = np.concatenate(groups)
    mean, spread = float(every.mean()), float(np.std(every, ddof=1)) if len(every) > 1 else 0.0
    by_run, by_building = _within(groups), _between(groups)
    ends: tuple[float | None, float | None] = (None, None)
    wide = ends
    if by_run is not None:
        ends = _studentised(groups, by_run, np.random.default_rng(seed))
    if by_building is not None:
        off = by_building.error * float(stdtrit(by_building.dof, 0.5 * (1 + LEVEL)))
        wide = mean - off, mean + off
    firm = by_building or by_run
    p = None if firm is None else firm.p_of(mean)
    return Estimate(mean, *ends, *wide, len(every), mean / spread if spread > 0 else None, p)


def mean_interval(values: Float[np.ndarray, " n"], seed: int = 0) -> tuple[float, float] | None:
    """Return the 95 % interval of the mean of independent values; None for fewer than five."""
    found = estimate({("", k): float(value) for k, value in enumerate(values)}, seed)
    return None if found is None or found.low is None or found.high is None else (found.low, found.high)


def holm(ps: Sequence[float]) -> Float[np.ndarray, " n"]:
    """Return the p-values of a family of tests as corrected for its size (Holm, 1979), in the order given.

    Those below 0.05 are clear: of true null hypotheses at most one in twenty families rejects any.
    """
    given = np.asarray(ps, dtype=np.float64)
    order = np.argsort(given, kind="stable")
    stepped = np.maximum.accumulate(given[order] * np.arange(len(given), 0, -1))
    corrected = np.empty(len(given))
    corrected[order] = np.minimum(stepped, 1.0)
    return corrected


def paired(first: Clustered, second: Clustered) -> dict[tuple[str, int], float]:
    """Return first less second, over the runs that both have."""
    return {run: value - second[run] for run, value in first.items() if run in second}


def share_better(first: Clustered, second: Clustered, runs: set[tuple[str, int]]) -> float | None:
    """Return the share of runs in which the first value is the smaller one; a missing value is a failure and loses.

    Ties, and runs in which both failed, count half.
    """
    if not runs:
        return None
    worst = float("inf")
    a = np.array([first.get(run, worst) for run in sorted(runs)])
    b = np.array([second.get(run, worst) for run in sorted(runs)])
    return float(np.mean((a < b) + 0.5 * (a == b)))


@dataclass(frozen=True)
class _Error:
    """The standard error of a mean, and its degrees of freedom."""

    error: float
    dof: float

    def p_of(self, mean: float) -> float:
        if self.error <= 0.0:
            return float(mean == 0.0)
        return float(2.0 * stdtr(self.dof, -abs(mean) / self.error))


def _by_building(values: Clustered) -> list[Float[np.ndarray, " _"]]:
    buildings = sorted({building for building, _ in values})
    return [np.array([values[run] for run in sorted(values) if run[0] == building]) for building in buildings]


def _within(groups: Sequence[Float[np.ndarray, " _"]]) -> _Error | None:
    """Return the error of the mean over runs for these buildings, its degrees of freedom by Welch and Satterthwaite."""
    sizes = np.array([len(group) for group in groups])
    if sizes.sum() < LEAST or sizes.min() < 2:
        return None
    parts = np.array([np.var(group, ddof=1) for group in groups]) * sizes / sizes.sum() ** 2
    total = float(parts.sum())
    dof = total**2 / float(np.sum(parts**2 / (sizes - 1))) if total > 0 else float(sizes.sum() - len(sizes))
    return _Error(float(np.sqrt(total)), dof)


def _between(groups: Sequence[Float[np.ndarray, " _"]]) -> _Error | None:
    """Return the error of the mean over runs for other buildings: each building is one draw, weighted by its runs."""
    count = len(groups)
    if count < LEAST:
        return None
    every = np.concatenate(groups)
    off = np.array([np.sum(group - every.mean()) for group in groups]) / len(every)
    return _Error(float(np.sqrt(count / (count - 1) * np.sum(off**2))), count - 1.0)


def _studentised(
    groups: Sequence[Float[np.ndarray, " _"]], stated: _Error, rng: np.random.Generator
) -> tuple[float, float]:
    """Return the ends of the interval: the resamples' own t takes the place of Student's, which knows no skew."""
    shift, variance, total = np.zeros(DRAWS), np.zeros(DRAWS), sum(map(len, groups))
    for group in groups:
        n, off = len(group), group - group.mean()
        weights = rng.multinomial(n, np.full(n, 1.0 / n), size=DRAWS)
        mean = weights @ off / n
        shift += mean * n / total
        variance += np.maximum(weights @ off**2 / n - mean**2, 0.0) * n / (n - 1) * n / total**2
    flat = variance <= 1e-24 * max(stated.error**2, 1e-300)
    t = shift / np.sqrt(np.where(flat, 1.0, variance))
    t[flat] = np.copysign(np.inf, shift[flat])
    t[flat & (shift == 0.0)] = 0.0
    tails = np.quantile(t, [0.5 * (1 - LEVEL), 0.5 * (1 + LEVEL)], method="inverted_cdf")
    # If most values are identical, many resamples have no spread and hence no t.
    student = float(stdtrit(stated.dof, 0.5 * (1 + LEVEL)))
    low, high = np.where(np.isfinite(tails), tails, [-student, student])
    middle = float(np.concatenate(groups).mean())
    return middle - float(high) * stated.error, middle - float(low) * stated.error
