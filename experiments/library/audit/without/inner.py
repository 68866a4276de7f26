"""Normalised differences between data and their own prediction, and what can be told from them without a truth."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.estimation.gates import gate_level

from ....campaign.comparison.consistency import OVERCONFIDENT
from ....views.numbers import number, percent
from ..draws import interval
from ..verdicts import Pooled, Verdict, judge, mean_of_runs

INSIDE = 0.95
SURE = 0.05
"""Probability with which one of a consistent series is called a misfit."""
MOST_TOLD = 5
"""Misfits that are named."""


@dataclass(frozen=True)
class Told:
    """What a kind of data can say, and what not."""

    subject: str
    """Whose covariances are judged."""
    what: str
    """Of what there are n."""
    statistic: str
    can: str
    cannot: str
    along: str = "time (s)"


@dataclass(frozen=True)
class Inner:
    """The squared normalised differences of n innovations, loop closures or triangles."""

    name: str
    told: Told
    at: Float[np.ndarray, " n"]
    """Their times, s, or the ids of poses."""
    squared: Float[np.ndarray, " n"]
    dof: Int[np.ndarray, " n"]
    """Degrees of freedom of each."""
    names: tuple[str, ...]
    """Of each; none where they are not told."""
    effective_dof: float
    """Degrees of freedom of their sum, as they depend on each other."""
    notes: tuple[str, ...] = ()
    least: float = 1.0
    """The mean of a consistent series, where a gate cuts off the largest; 1 without."""
    estimator: str = ""
    """The back end of a run of ours."""
    is_judged: bool = True
    """Whether their scale is known; if it was estimated from themselves, only misfits are told."""

    @property
    def kind(self) -> str:
        """What is alike in runs that can be pooled."""
        return f"{self.told.what} of {self.estimator}" if self.estimator else self.told.what

    @property
    def mean(self) -> float:
        """Their sum over its degrees of freedom: 1 is ideal."""
        return float(self.squared.sum()) / float(self.dof.sum())

    @property
    def interval(self) -> tuple[float, float]:
        """The 95 % interval of the mean."""
        return interval(self.mean, self.effective_dof)

    @property
    def draws(self) -> float:
        """Effective sample size."""
        return len(self.dof) * self.effective_dof / float(self.dof.sum())

    @property
    def verdict(self) -> Verdict | None:
        """The verdict on the subject; None if it cannot be judged."""
        if not self.is_judged:
            return None
        return _judged(self.mean, *self.interval, self.effective_dof, self.least)

    @property
    def covered(self) -> float:
        """The share inside their 95 % regions."""
        return float(np.mean(self.squared <= _levels(INSIDE, self.dof)))

    @property
    def misfits(self) -> Int[np.ndarray, " k"]:
        """Rows beyond the level that none of a consistent series exceeds with 95 %, the largest first."""
        level = 1.0 - SURE / len(self.dof)
        rows = np.flatnonzero(self.squared > _levels(level, self.dof))
        return rows[np.argsort(-(self.squared / self.dof)[rows], kind="stable")]

    def lines(self) -> list[str]:
        """Return it in words."""
        told, verdict, (low, high) = self.told, self.verdict, self.interval
        first = f"{self.name}: {told.subject}: {verdict.told()}" if verdict else f"{self.name}: {told.subject}"
        ideal = "1" if self.least == 1.0 else f"{number(self.least)} to 1"
        between = f" (95 % interval {number(low)} to {number(high)}; ideally {ideal})" if verdict else ""
        sizes = f", effective sample size {number(self.draws, 2)}" if verdict else ""
        lines = [
            first,
            f"  {told.statistic} {number(self.mean)}{between}: {len(self.dof):,} {told.what}{sizes};"
            f" {percent(self.covered)} % of them inside their 95 % region",
        ]
        if (misfits := self._misfits()) is not None:
            lines.append(f"  {misfits}")
        lines += [f"  tells: {told.can}", f"  cannot tell: {told.cannot}"]
        return [*lines, f"  note: {'; '.join(self.notes)}"] if self.notes else lines

    def _misfits(self) -> str | None:
        rows = self.misfits
        if not len(rows) or not self.names:
            return None
        listed = "; ".join(self.names[row] for row in rows[:MOST_TOLD]) + ("; ..." if len(rows) > MOST_TOLD else "")
        rest = np.delete(np.arange(len(self.dof)), rows)
        without = float(self.squared[rest].sum()) / max(float(self.dof[rest].sum()), 1.0)
        return f"{len(rows)} {self.told.what} do not fit: {listed}; without them {number(without)}"

    def record(self) -> dict[str, Any]:
        """Return all figures, by name."""
        verdict, (low, high) = self.verdict, self.interval
        return {
            "file": self.name, "subject": self.told.subject, "verdict": verdict and verdict.words,
            "factor": verdict and verdict.factor, "factor_interval": verdict and verdict.factor_interval,
            "statistic": self.told.statistic, "mean": self.mean, "ideally": [self.least, 1.0],
            "interval": [low, high] if verdict else None,
            "count": len(self.dof), "what": self.told.what,
            "effective_samples": self.draws if verdict else None, "inside_95": self.covered,
            "misfits": [self.names[row] for row in self.misfits] if self.names else len(self.misfits),
            "tells": self.told.can, "cannot_tell": self.told.cannot, "notes": list(self.notes),
        }  # fmt: skip


def pool(found: Sequence[Inner]) -> Pooled:
    """Return the mean over independent runs of one kind, whose scale is known, with its verdict."""
    mean, low, high, dof = mean_of_runs([each.mean for each in found], [each.effective_dof for each in found])
    least = float(np.mean([each.least for each in found]))
    return Pooled(len(found), mean, low, high, _judged(mean, low, high, dof, least), found[0].told.statistic)


def _judged(mean: float, low: float, high: float, dof: float, least: float) -> Verdict:
    """Return the verdict on a mean that ideally lies between `least` and 1."""
    plain = judge(mean, low, high, dof)
    return plain if plain.words == OVERCONFIDENT else judge(mean / least, low / least, high / least, dof)


def _levels(probability: float, dof: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    known, of = np.unique(dof, return_inverse=True)
    return np.array([gate_level(probability, int(each)) for each in known])[of]
