"""Do the intervals and tests hold their level? Campaigns of values of known mean, drawn thousands of times.

.venv/bin/python -m studies.results.levels
"""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float
from rich.table import Table

from chainslam.experiments.scoring.statistics import LEVEL, Clustered, Estimate, estimate, holm
from chainslam.experiments.terminal.console import plain_console
from chainslam.slam.evaluation.consistency import pooled_band

from ..runner.command import run_study

Draw = Callable[[np.random.Generator, int], Float[np.ndarray, " n"]]
DRAWS_OF: dict[str, Draw] = {
    "normal": lambda rng, count: 1.0 + rng.normal(size=count),
    "chi-square, 3 degrees": lambda rng, count: rng.chisquare(3, count) / 3.0,
    "exponential": lambda rng, count: rng.exponential(size=count),
    "log-normal, sigma 0.5": lambda rng, count: rng.lognormal(-0.125, 0.5, count),
}
"""Values of mean 1; the NEES of an error that lasts a run is the second, over its degrees of freedom."""
SPREADS = (0.0, 1.0, 2.0)
"""Standard deviation between buildings, over that between the runs of one."""
FAMILY = 77
"""Eleven measures of seven back ends."""


@dataclass(frozen=True)
class LevelStudy:
    """Print which share of the 95 % intervals holds the mean, and how often chance alone is taken for more."""

    counts: tuple[int, ...] = (5, 10, 20)
    """Runs of one building."""
    buildings: int = 6
    """Buildings, each with the runs below."""
    runs: int = 10
    """Runs of each of several buildings."""
    cases: int = 2000
    """Campaigns of each kind."""
    first_seed: int = 1
    """Of the draws."""

    def run(self) -> None:
        """Print the table."""
        table = Table(
            "values", "campaign", "holds the mean %", title=f"{self.cases} campaigns each; aimed at 93 to 97 %"
        )
        rng = np.random.default_rng(self.first_seed)
        for name, draw in DRAWS_OF.items():
            for count in self.counts:
                share = held([of_runs(rng, draw, count) for _ in range(self.cases)])[0]
                table.add_row(name, f"{count} runs", f"{100 * share:.1f}")
        for spread in SPREADS:
            words = f"{self.buildings} buildings that differ by {spread:g} sigma, {self.runs} runs each"
            campaigns = [of_buildings(rng, self.buildings, self.runs, spread) for _ in range(self.cases)]
            by_run, by_building = held(campaigns)
            table.add_row("normal", f"{words}: by building", f"{100 * by_building:.1f}")
            table.add_row("normal", f"{words}: by run, which is for these alone", f"{100 * by_run:.1f}")
        for lasting in (1.0, 0.5):
            inside = 1.0 - np.mean([outside_band(rng, 20, 100, lasting) for _ in range(self.cases)])
            table.add_row("NEES", f"pooled band of 20 runs, {lasting:g} of the error lasts", f"{100 * inside:.1f}")
        any_clear = 100 * np.mean(
            [(holm(rng.uniform(size=FAMILY).tolist()) < 1 - LEVEL).any() for _ in range(self.cases)]
        )
        plain_console(width=120).print(table)
        print(f"families of {FAMILY} comparisons without any difference in which one is clear: {any_clear:.1f} %")


def of_runs(rng: np.random.Generator, draw: Draw, count: int) -> Clustered:
    """Return the values of one building's runs, of mean 1."""
    return {("one", seed): float(value) for seed, value in enumerate(draw(rng, count))}


def of_buildings(rng: np.random.Generator, buildings: int, runs: int, spread: float) -> Clustered:
    """Return normal values of several buildings, of mean 1 over all buildings that there might be."""
    offsets = 1.0 + spread * rng.normal(size=buildings)
    return {(f"b{b}", seed): float(offsets[b] + rng.normal()) for b in range(buildings) for seed in range(runs)}


def held(campaigns: list[Clustered]) -> tuple[float, float]:
    """Return which share of the intervals holds 1, by run and by building; NaN where there is none."""
    found = [each for k, values in enumerate(campaigns) if (each := estimate(values, seed=k)) is not None]
    return _share([(each.low, each.high) for each in found]), _share([_wide(each) for each in found])


def _wide(found: Estimate) -> tuple[float | None, float | None]:
    return found.low_buildings, found.high_buildings


def _share(ends: list[tuple[float | None, float | None]]) -> float:
    told = [low <= 1.0 <= high for low, high in ends if low is not None and high is not None]
    return float(np.mean(told)) if told else float("nan")


def outside_band(rng: np.random.Generator, runs: int, steps: int, lasting: float) -> bool:
    """Return whether the ANEES of an ideal estimate lies outside its band; a share of its error lasts as a run does."""
    error = lasting**0.5 * rng.normal(size=(runs, 1, 3)) + (1.0 - lasting) ** 0.5 * rng.normal(size=(runs, steps, 3))
    nees = np.sum(error**2, axis=-1)
    low, high = pooled_band(list(nees), 3)
    return not low <= float(nees.mean()) / 3.0 <= high


if __name__ == "__main__":
    run_study(LevelStudy)
