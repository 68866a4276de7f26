"""How many inputs of each kind are read rightly, refused in one line, or read wrongly.

.venv/bin/python -m tests.kinds --count 40 --page docs/contributing/testing.md
"""

import sys
import tempfile
from collections import Counter
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from .case import verdict
from .registry import KINDS

BEGIN, END = "<!-- kinds -->\n", "<!-- end of kinds -->\n"
COLUMNS = "right", "refused", "wrong"


@dataclass(frozen=True)
class Kinds:
    """Try inputs of each kind, and print a table."""

    count: int = 100
    """How many of each kind."""
    seed: int = 1
    """Decides all of them."""
    only: tuple[str, ...] = ()
    """Kinds that hold one of these words; all by default."""
    page: Path | None = None
    """A page that takes the table between its marks."""


def main() -> int:
    """Run what the command line says and return the exit status: 0 where nothing was read wrongly."""
    wanted = tyro.cli(Kinds, prog="tests.kinds")
    found: dict[str, Counter[str]] = {}
    for kind in [kind for kind in KINDS if not wanted.only or any(word in kind for word in wanted.only)]:
        found[kind] = Counter(_tried(kind, wanted.seed, number) for number in range(wanted.count))
    table = table_of(found, wanted.seed)
    print(table, end="")
    if wanted.page is not None:
        text = wanted.page.read_text()
        before, after = text.partition(BEGIN)[0], text.partition(END)[2]
        wanted.page.write_text(f"{before}{BEGIN}{table}{END}{after}")
    return 1 if any(counts["wrong"] for counts in found.values()) else 0


def _tried(kind: str, seed: int, number: int) -> str:
    with tempfile.TemporaryDirectory() as folder:
        end, fault = verdict(KINDS[kind](np.random.default_rng([seed, number]), Path(folder)))
    if fault:
        print(f"{kind}, {number}: {fault}", file=sys.stderr)
    return end


def table_of(found: Mapping[str, Mapping[str, int]], seed: int) -> str:
    """Return a row for each kind, and their sum."""
    rows = [f"Seed {seed}.\n", f"| kind | tried | {' | '.join(COLUMNS)} |", "|---|---|---|---|---|"]
    whole = {"**all**": {end: sum(counts[end] for counts in found.values()) for end in COLUMNS}}
    for kind, counts in {**found, **whole}.items():
        numbers = [sum(counts[end] for end in COLUMNS), *(counts[end] for end in COLUMNS)]
        rows.append(f"| {kind} | {' | '.join(map(str, numbers))} |")
    return "\n".join(rows) + "\n"


if __name__ == "__main__":
    sys.exit(main())
