"""Rows of `chainslam benchmark`, added to those of the site's table.

.venv/bin/python -m studies.runner.leaderboard results/leaderboard/rows.jsonl     # and then `make results`
"""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from chainslam.experiments.campaign.comparison.benchmark import read_all

from .rows import Row, append, last

ROWS = Path("studies/results/rows/leaderboard.jsonl")
NAMES = ("benchmark", "estimator", "estimator_version")


@dataclass(frozen=True)
class Leaderboard:
    """Add rows to the stored ones; of each estimator and version the last row counts."""

    rows: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="FILE")]
    """Files of rows."""

    def run(self) -> None:
        """Add those that can be cited, and print which cannot; raises UsageError for other files."""
        rows = read_all(self.rows)
        append(ROWS, [row for row in rows if row["not_citable"] is None])
        for row in rows:
            if row["not_citable"] is not None:
                print(f"left out: {row['estimator']}, {row['not_citable']}")


def stored() -> list[Row]:
    """Return the rows of the site's table."""
    return last(ROWS, NAMES)


if __name__ == "__main__":
    tyro.cli(Leaderboard, description=__doc__).run()
