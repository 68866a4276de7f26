"""The pages of results, made from stored rows; says which of them are of another code than this one.

.venv/bin/python -m studies.results.page
"""

import json
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import tyro

from ..runner.rows import Row, fingerprint
from .figures import Found
from .headlines import HEADLINES, Headline

DOCS = Path("docs")
BEGIN, END = "<!-- made by `make results` -->", "<!-- end -->"


@dataclass(frozen=True)
class Results:
    """Put the headline tables between two marks of their pages, and print which rows are stale."""

    docs: Path = DOCS
    """The folder of the pages; all else on them stays."""

    def run(self) -> None:
        """Write the pages and print a line for each table."""
        found = [(headline, newest(headline.rows, headline.each)) for headline in HEADLINES]
        for name in dict.fromkeys(headline.page for headline in HEADLINES):
            page = self.docs / name
            text = page.read_text()
            head, tail = text[: text.index(BEGIN)], text[text.index(END) :]
            body = "\n".join(section(headline, rows) for headline, rows in found if rows and headline.page == name)
            page.write_text(f"{head}{BEGIN}\n\n{body}\n{tail}")
        for headline, rows in found:
            print(f"{state(rows)}: {headline.title} ({len(rows)} rows in {headline.rows}; {headline.command})")


def state(rows: Sequence[Row]) -> str:
    """Return in one word how rows stand to the code as it is."""
    if not rows:
        return "missing"
    return "current" if all(row["code"] == fingerprint() for row in rows) else "stale"


def newest(path: Path, each: str = "") -> list[Row]:
    """Return the rows of the code that has most of them in a file, the last one where several have.

    With `each`, of every value under this name: what is made one by one may be of several codes.
    """
    if not path.exists():
        return []
    groups: dict[str, list[Row]] = {}
    for line in path.read_text().splitlines():
        row: Row = json.loads(line)
        groups.setdefault(row[each] if each else "", []).append(row)
    counts = {name: Counter(row["code"] for row in reversed(rows)) for name, rows in groups.items()}
    return [row for name, rows in groups.items() for row in rows if row["code"] == counts[name].most_common(1)[0][0]]


def section(headline: Headline, rows: Sequence[Row]) -> str:
    """Return the part of the page for one table."""
    found = headline.make(rows)
    count = f"{len(rows)} row{'s' * (len(rows) > 1)}"
    made = f"{count}, made by `{headline.command}`."
    parts = [f"## {headline.title}", f"**Aim.** {headline.aim}"]
    if found.parts:
        parts += [f"### {title}\n\n{_told(part)}" for title, part in found.parts.items()]
    else:
        parts.append(_told(found))
    return "\n\n".join([*parts, made]) + "\n"


def _told(found: Found) -> str:
    head, *lines = ["| " + " | ".join(cells) + " |" for cells in found.table]
    rule = "|" + "---|" * len(found.table[0])
    return "\n".join([head, rule, *lines]) + f"\n\n**Verdict.** {found.verdict}"


if __name__ == "__main__":
    tyro.cli(Results, description=__doc__).run()
