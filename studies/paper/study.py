"""The numbers of the paper's figures, one drive for each seed, stored; `make results` makes their tables.

.venv/bin/python -m studies.paper.study --seeds 20      # goes on where it was interrupted
"""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

from chainslam.experiments.reproductions import REPRODUCTIONS
from chainslam.experiments.usage import choose

from ..runner.command import run_study
from ..runner.rows import Row, rows_of
from .page import NAMES, ROWS

TOGETHER = (("table1", "fig8"), ("fig9",), ("fig10", "fig11"), ("fig5", "fig6"), ("eq4",), ("fig4",))
"""Figures of one drive, which is made once for all of them."""


@dataclass(frozen=True)
class PaperStudy:
    """Drive for each of the paper's figures with each seed, and store the numbers."""

    figures: tuple[str, ...] = tuple(REPRODUCTIONS)
    """Names as of `chainslam reproduce`."""
    seeds: int = 20
    """Drives for each figure."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    jobs: int = 2
    """Number of processes."""
    out: Path = ROWS
    """A line of JSON for each figure and seed, as it comes. What it holds of the same code is not run again."""

    def run(self) -> None:
        """Run what is to be run; raises UsageError for bad names and another file."""
        for name in self.figures:
            choose("figure", name, REPRODUCTIONS)
        groups = [tuple(name for name in group if name in self.figures) for group in TOGETHER]
        tasks = [
            ((group, seed), [(name, seed) for name in group])
            for seed in range(self.first_seed, self.first_seed + self.seeds)
            for group in groups
            if group
        ]
        rows = list(rows_of(self.out, NAMES, tasks, numbers_of, self.jobs))
        print(f"{len(rows)} rows in {self.out}; `make results` makes their tables")


def numbers_of(task: tuple[tuple[str, ...], int]) -> Sequence[Row]:
    """Return a row for each figure of a group: the numbers of one drive by each back end."""
    group, seed = task
    return [{"figure": name, "seed": seed, "numbers": REPRODUCTIONS[name].numbers(seed)} for name in group]


if __name__ == "__main__":
    run_study(PaperStudy)
