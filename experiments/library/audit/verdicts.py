"""From a mean NEES with its interval to a verdict: of one trajectory, of several runs, of one estimator to another."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ...campaign.comparison.consistency import CAUTIOUS, CONSISTENT, OVERCONFIDENT, WITHIN
from ...scoring.statistics import FEW_RUNS, estimate, mean_interval
from ...views.numbers import number
from .draws import Score, interval, pooled_dof

TOO_FEW = "too few data to tell"
NO_MATTER = 1.21
"""An ANEES within this factor of 1, errors within 10 % of the stated sigma, is consistent however sure it is."""
LEAST_DOF = 10.0
"""A few errors that last may be small by luck: with fewer degrees of freedom nothing is called too cautious."""
STRETCH = 4.0
"""Times that an error lasts: means over shorter stretches are not independent."""


@dataclass(frozen=True)
class Verdict:
    """What an ANEES says of the covariances."""

    words: str
    factor: float | None
    """Error over stated sigma, the root of the ANEES, of an overconfident estimate; its inverse of a cautious one."""
    factor_interval: tuple[float, float] | None

    def told(self) -> str:
        """Return the verdict as the beginning of a sentence."""
        if self.factor is None or self.factor_interval is None:
            return self.words
        ratio = "error over stated sigma" if self.words == OVERCONFIDENT else "stated sigma over error"
        low, high = map(number, self.factor_interval)
        return f"{self.words} by a factor of {number(self.factor)} ({ratio}, 95 % interval {low} to {high})"


def judge(anees: float, low: float, high: float, dof: float = float("inf"), is_bound: bool = False) -> Verdict:
    """Return the verdict on an ANEES with its 95 % interval; `is_bound` says that it may be larger, never smaller."""
    root = float(np.sqrt(anees)), float(np.sqrt(low)), float(np.sqrt(high))
    if not is_bound and low >= 1.0 / NO_MATTER and high <= NO_MATTER:
        return Verdict(CONSISTENT, None, None)
    if low > 1.0:
        return Verdict(OVERCONFIDENT, root[0], root[1:])
    if not is_bound and high < 1.0 and dof >= LEAST_DOF:
        inverse = [1.0 / value if value > 0.0 else float("inf") for value in root]
        return Verdict(CAUTIOUS, inverse[0], (inverse[2], inverse[1]))
    if not is_bound and low >= 1.0 / WITHIN and high <= WITHIN:
        return Verdict(CONSISTENT, None, None)
    return Verdict(TOO_FEW, None, None)


@dataclass(frozen=True)
class Pooled:
    """The mean ANEES of several runs of one estimator, or of what stands for it without a truth."""

    runs: int
    mean: float
    low: float
    high: float
    verdict: Verdict
    statistic: str = "ANEES"

    def record(self) -> dict[str, Any]:
        """Return all figures, by name."""
        name = "anees" if self.statistic == "ANEES" else "mean"
        return {
            "runs": self.runs, "verdict": self.verdict.words, "factor": self.verdict.factor,
            "factor_interval": self.verdict.factor_interval, "statistic": self.statistic, name: self.mean,
            f"{name}_interval": [self.low, self.high],
        }  # fmt: skip


def pool(scores: Sequence[Score]) -> Pooled:
    """Return the mean ANEES of independent runs and its verdict."""
    mean, low, high, dof = mean_of_runs([each.anees for each in scores], [each.dof for each in scores])
    return Pooled(len(scores), mean, low, high, judge(mean, low, high, dof))


def mean_of_runs(values: Sequence[float], dofs: Sequence[float]) -> tuple[float, float, float, float]:
    """Return the mean over independent runs of means with so many degrees of freedom, its 95 % interval, and theirs.

    From ten runs on the interval is the studentised one over runs; of fewer, by chi-square with the degrees of freedom
    of all runs together.
    """
    mean, dof = float(np.mean(values)), pooled_dof(dofs)
    found = mean_interval(np.array(values)) if len(values) >= FEW_RUNS else None
    if found is None:
        return mean, *interval(mean, dof), dof
    return mean, max(found[0], 0.0), found[1], float("inf")


@dataclass(frozen=True)
class Pair:
    """How many times the NEES of the first estimate is that of the second one, at the same times."""

    first: str
    second: str
    ratio: float
    interval: tuple[float, float] | None
    """95 % interval; None where too few independent errors tell it."""
    blocks: int

    def told(self) -> str:
        """Return it as a sentence."""
        words = f"{self.first} against {self.second}: {number(self.ratio)} times the NEES"
        if self.interval is None:
            return f"{words}, and too few data to tell them apart"
        low, high = self.interval
        differ = "" if low > 1.0 or high < 1.0 else ", which is no clear difference"
        return f"{words} (95 % interval {number(low)} to {number(high)}, paired in {self.blocks} stretches{differ})"


def compare(
    names: tuple[str, str], first: Float[np.ndarray, " n"], second: Float[np.ndarray, " n"], draws: float
) -> Pair:
    """Return the comparison of two series of NEES at the same times with an effective sample size of `draws`.

    The series are cut into stretches several times as long as errors last, and the logarithms of their mean NEES are
    compared in pairs, by Student's t.
    """
    blocks = max(int(min(draws, len(first)) / STRETCH), 1)
    logs = [
        np.log([max(float(part.mean()), 1e-300) for part in np.array_split(series, blocks)])
        for series in (first, second)
    ]
    off = logs[0] - logs[1]
    found = estimate({(str(k), 0): float(value) for k, value in enumerate(off)})
    ends: tuple[float, float] | None = None
    if found is not None and found.low_buildings is not None and found.high_buildings is not None:
        ends = float(np.exp(found.low_buildings)), float(np.exp(found.high_buildings))
    return Pair(*names, float(np.exp(np.mean(off))), ends, blocks)
