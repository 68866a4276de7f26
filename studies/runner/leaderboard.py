"""Rows of `chainslam benchmark`, added to the stored ones.

.venv/bin/python -m studies.runner.leaderboard results/leaderboard/rows.jsonl
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from chainslam.experiments.campaign.comparison.benchmark import read_all

from .rows import append

ROWS = Path("studies/results/rows/leaderboard.jsonl")


@dataclass(frozen=True)
class Leaderboard:
    """Add rows to the stored ones."""

    rows: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FILE")]
    """Files of rows."""

    def run(self) -> None:
        """Add those that can be cited, and print which cannot; raises UsageError for other files."""
        rows = read_all(self.rows)
        append(ROWS, [row for row in rows if row["not_citable"] is None])
        for row in rows:
            if row["not_citable"] is not None:
                print(f"left out: {row['estimator']}, {row['not_citable']}")


if __name__ == "__main__":
    tyro.cli(Leaderboard, description=__doc__).run()
