"""Does a strategy that turns back by predicted inconsistency make up for the filter? Paired, at equal metres.

.venv/bin/python -m studies.exploration.adaptive      # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from rich.table import Table

from chainslam.experiments.scenario import P0, TrialConfig
from chainslam.experiments.scoring.statistics import Clustered, estimate, paired
from chainslam.experiments.terminal.console import plain_console

from ..runner.command import run_study
from ..runner.explored import explored
from ..runner.rows import Row, key_of, read
from ..runner.trials import scored

NAMES = ("world", "p0", "backend", "strategy", "seed", "max_path_m")
MEASURES = {
    "wall_rmse_m": "error of the walls",
    "wall_shape_m": "error of the map's shape",
    "double_entries": "duplicate walls",
    "pose_anees": "pose ANEES",
    "map_anees": "map ANEES",
    "coverage": "coverage",
}
RATIOS = ("wall_rmse_m", "wall_shape_m", "pose_anees", "map_anees")
"""Compared by their logarithms; of the others the difference counts."""
Contender = tuple[str, str]


@dataclass(frozen=True)
class AdaptiveStudy:
    """Explore each world with each back end and strategy for the same metres, and print what came of it."""

    worlds: tuple[str, ...] = ("hall", "paper-fig9", "rooms", "paper-fig5")
    """Bundled names or files."""
    backends: tuple[str, ...] = ("block-ekf", "relocation-ekf", "full-ekf", "invariant-ekf", "graph")
    """The estimators."""
    strategies: tuple[str, ...] = ("adaptive", "nearest-robot", "nearest-start")
    """Names or schedules; the first is held against the others."""
    p0: tuple[P0, ...] = ("small",)
    """Covariances of the start."""
    seeds: int = 10
    """Trials for each."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    metres: float = 60.0
    """So far each robot drives, unless it has finished before; then its last state counts."""
    against: str = "full-ekf"
    """The back end whose nearest-robot is what a strategy is to make up for."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/adaptive.jsonl")
    """A line of JSON for each run; what it holds of the same code already is not run again."""
    only_report: bool = False
    """Print the comparison of what is there."""

    def trials(self) -> list[TrialConfig]:
        """Return the trials, seed by seed, so that what is there is balanced."""
        return [
            TrialConfig(world, backend, strategy, seed, p0, max_path_m=self.metres)
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for world in self.worlds
            for p0 in self.p0
            for backend in self.backends
            for strategy in self.strategies
        ]

    def run(self) -> None:
        """Run what is to be run and print both tables; raises UsageError for bad names and another file."""
        if self.only_report:
            rows = [row for row in read(self.out, NAMES) if row["max_path_m"] == self.metres]
        else:
            rows = scored(self.trials(), self.out, _known_by, explored, self.jobs)
        console = plain_console(width=160)
        console.print(returns_table(rows, self.strategies[0]))
        for p0 in self.p0:
            own = [row for row in rows if row["p0"] == p0]
            for backend in self.backends:
                first = backend, self.strategies[0]
                others = [(backend, strategy) for strategy in self.strategies[1:]]
                others += [(self.against, "nearest-robot")] if backend != self.against else []
                console.print(comparison_table(own, first, others, f"p0 {p0}"))


def _known_by(trial: TrialConfig) -> Row:
    return {name: getattr(trial, name) for name in NAMES}


def returns_table(rows: Sequence[Row], strategy: str) -> Table:
    """Return how often a strategy turned back with each back end, beside how honest that was."""
    shown = Table(title=f"{strategy}: returns per 100 m, beside the median pose ANEES", title_justify="left")
    for column in ("world", "p0", "back end"):
        shown.add_column(column)
    for column in ("runs", "metres", "returns", "per 100 m", "pose ANEES", "duplicate walls"):
        shown.add_column(column, justify="right")
    own = [row for row in rows if row["strategy"] == strategy]
    for world, p0, backend in dict.fromkeys((row["world"], row["p0"], row["backend"]) for row in own):
        here = [row for row in own if (row["world"], row["p0"], row["backend"]) == (world, p0, backend)]
        metres, returns = _values(here, "path_length_m").sum(), _values(here, "returns").sum()
        anees, doubles = _values(here, "pose_anees"), _values(here, "double_entries")
        shown.add_row(
            world, p0, backend, str(len(here)), f"{metres:.0f}", f"{returns:.0f}",
            f"{100.0 * returns / max(metres, 1e-9):.1f}", f"{np.median(anees):.2f}" if len(anees) else "-",
            f"{doubles.mean():.2f}" if len(doubles) else "-",
        )  # fmt: skip
    return shown


def comparison_table(rows: Sequence[Row], first: Contender, others: Sequence[Contender], words: str) -> Table:
    """Return the first (back end, strategy) against others, paired by world and seed, with 95 % intervals by run.

    What one run of a pair lacks leaves the pair out.
    """
    shown = Table(title=f"{', '.join(first)}, {words}", title_justify="left")
    for column in ("against", *MEASURES.values()):
        shown.add_column(column)
    for other in others:
        cells = []
        for key in MEASURES:
            found = estimate(paired(values_of(rows, first, key), values_of(rows, other, key)))
            if found is None:
                cells.append("-")
                continue
            sign, digits = ("x", 2) if key in RATIOS else ("", 3 if key == "coverage" else 2)
            numbers = [found.mean] if found.low is None or found.high is None else [found.mean, found.low, found.high]
            mean, *ends = (f"{x:.{digits}f}" for x in (np.exp(numbers) if key in RATIOS else numbers))
            within = f" ({' to '.join(ends)})" if ends else ""
            cells.append(f"{sign}{mean}{within}, {found.runs}")
        shown.add_row(", ".join(other), *cells)
    return shown


def values_of(rows: Sequence[Row], contender: Contender, key: str) -> Clustered:
    """Return a measure by world and seed, as a logarithm where ratios count."""
    found = {}
    for row in rows:
        if key_of(row, ("backend", "strategy")) == contender and row.get(key) is not None:
            if key not in RATIOS:
                found[row["world"], row["seed"]] = float(row[key])
            elif row[key] > 0.0:
                found[row["world"], row["seed"]] = float(np.log(row[key]))
    return found


def _values(rows: Sequence[Row], key: str) -> Float[np.ndarray, " n"]:
    return np.array([row[key] for row in rows if row.get(key) is not None], dtype=np.float64)


if __name__ == "__main__":
    run_study(AdaptiveStudy)
