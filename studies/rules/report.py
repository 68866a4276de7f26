"""The table of docs/contributing/rules.md, from what was stored of the tests and of the runs.

.venv/bin/python -m studies.rules.report
"""

import json
import sys
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from ..runner.marks import filled
from .table import SWITCHES, WHAT
from .verdicts import BASELINE, LIKELY, Row, changes, worse


@dataclass(frozen=True)
class Report:
    """Put the tables of rules and of their verdicts between two marks of a page."""

    held: Path = Path("studies/rules/held.jsonl")
    """Which test holds which rule."""
    rows: Path = Path("studies/rules/rows.jsonl")
    """The runs with all rules and with each off."""
    page: Path = Path("docs/contributing/rules.md")


def tables(held: Mapping[str, str], rows: Sequence[Row]) -> str:
    """Return the counts and a table of the rules of each module; `held` is the test of each rule that one holds."""
    modules: dict[str, list[str]] = {}
    for switch in SWITCHES:
        names = modules.setdefault(switch.module.replace(".", "/") + ".py", [])
        if switch.name not in names:
            names.append(switch.name)
    held_count = sum(rule in held for rule in WHAT)
    studied = sum(bool(changes(rows, rule)[0]) for rule in WHAT)
    plans = sum(row["rule"] == BASELINE for row in rows)
    lines = [
        f"{len(WHAT)} rules, {held_count} held by a test; {studied} switched off in up to {plans} of 45 plans.",
        "",
    ]
    for module, names in modules.items():
        lines += [
            f"### `{module}`",
            "",
            "| rule | what it does | changes a value in | switched off |",
            "|---|---|---|---|",
        ]
        lines += [
            f"| `{rule}` | {WHAT[rule]} | {_fires(rows, rule)} | {_verdict(held, rows, rule)} |" for rule in names
        ]
        lines.append("")
    return "\n".join(lines)


def _fires(rows: Sequence[Row], rule: str) -> str:
    base = [row for row in rows if row["rule"] == BASELINE]
    plans = sum(rule in row["fires"] for row in base)
    return f"{plans} of {len(base)} plans" if base else "not counted"


def _verdict(held: Mapping[str, str], rows: Sequence[Row], rule: str) -> str:
    words = []
    base, _ = changes(rows, rule)
    found = [each for each in worse(rows, rule) if each.sigmas > LIKELY]
    if found:
        words.append("worse: " + "; ".join(_sure(each.what, each.sigmas) for each in found[:3]))
    elif base:
        words.append(f"nothing worse in {len(base)} plans")
    if rule in held:
        words.append(f"fails `{held[rule].partition('::')[2].partition('[')[0]}`")
    return "; ".join(words) or "no test fails; not studied"


def _sure(what: str, sigmas: float) -> str:
    return what if np.isinf(sigmas) else f"{what} ({sigmas:.1f} sigmas)"


def read_lines(path: Path) -> list[Row]:
    """Return the rows of a file of JSON lines; none where there is no such file."""
    return [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []


def main() -> int:
    """Write the page and return the exit status."""
    report = tyro.cli(Report, prog="studies.rules.report")
    held = {row["rule"]: row["held_by"] for row in read_lines(report.held)}
    made = tables(held, read_lines(report.rows))
    report.page.write_text(filled(report.page.read_text(), lambda _: made.rstrip()))
    return 0


if __name__ == "__main__":
    sys.exit(main())
