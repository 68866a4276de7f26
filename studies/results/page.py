"""The tables of README and docs, made from stored rows; says which rows are of other code than this.

.venv/bin/python -m studies.results.page
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from chainslam.experiments.views.numbers import markdown

from ..runner.marks import filled
from ..runner.rows import Row, fingerprint
from .sources import SOURCES, Source

DOCS = Path("docs")
PAGES = (
    "../README.md",
    "benchmarks.md",
    *(f"contributing/{name}.md" for name in ("results", "paper", "robots", "logs")),
)


@dataclass(frozen=True)
class Results:
    """Write the tables between the marks of their pages, and print which rows are stale."""

    docs: Path = DOCS
    """The folder of the pages; all else on them stays."""

    def run(self) -> None:
        """Write the pages and print a line for each table."""
        found = {name: source.read() for name, source in SOURCES.items()}
        for page in (self.docs / name for name in PAGES):
            page.write_text(filled(page.read_text(), lambda name: part(SOURCES[name], found[name])))
        for name, rows in found.items():
            print(f"{state(rows)}: {name} ({len(rows)} rows; {SOURCES[name].command})")


def state(rows: Sequence[Row]) -> str:
    """Return in one word how rows stand to the code as it is."""
    if not rows:
        return "missing"
    return "current" if all(row["code"] == fingerprint() for row in rows) else "stale"


def part(source: Source, rows: Sequence[Row]) -> str:
    """Return what stands on a page of some rows: their tables, how many they are and what makes them."""
    if not rows:
        return f"`{source.command}` makes the rows of this table; none are stored."
    made = source.make(rows)
    tables = made if isinstance(made, Mapping) else {"": made}
    found = [text for above, table in tables.items() for text in (above, markdown(table)) if text]
    return "\n\n".join([*found, f"{len(rows):,} rows, made by `{source.command}`."])


if __name__ == "__main__":
    tyro.cli(Results, description=__doc__).run()
