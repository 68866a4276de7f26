"""The page of the paper's figures: a table of each, from the stored numbers of all drives.

.venv/bin/python -m studies.paper.page              # writes docs/paper.md anew
.venv/bin/python -m studies.paper.page --check      # says which tables are of other code than this; status 1 for any
"""

import json
import sys
from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.experiments.reproductions import REPRODUCTIONS
from chainslam.experiments.reproductions.reproduction import Value
from chainslam.viz.reports.report import PageTable

from ..runner.rows import Row, fingerprint
from .following_tables import following_section, read_following, strategies_in_words

ROWS, PAGE = Path("studies/paper/rows.jsonl"), Path("docs/paper.md")
HEAD = """# The paper's figures

This page is made by `make paper` from the rows in `studies/paper/`. For each figure `--preset paper-method` drives the
robot: the paper's filter, matching, navigation and wall following. The other back ends map the same scans with the same
mapper, and each matches with its own gate. `chainslam reproduce NAME --seed N` draws the picture of one drive.

A cell holds the median over the drives, and in brackets the least and the largest value. Counts have their mean
in place of the median. Of what is either so or not, a cell holds the share of the drives in which it is so.
"""
NOTES = {
    "table1": "Lengths are in metres, as measured between mapped corners.",
    "fig4": "After its exploration the robot goes to wall 8, and from there to wall 16, wall after wall of the route"
    " that the graph plans. Walls have the paper's numbers; one that has none there stands in brackets. What it finds"
    " open on the way is explored first.",
    "fig5": "In the paper motion and perception are without error. Here they have noise, a drive for each seed."
    " Sigmas are of each back end on the same observations, with the true association.",
    "fig6": "As figure 5. The ratio is that of two drives with one seed.",
    "fig9": "A wall counts as a duplicate where the last map holds it twice."
    " `chainslam reproduce fig9` tries seeds until a duplicate wall lasts 30 steps, and marks it.",
    "fig10": "The robot starts with an uncertainty of 0.1 m and 2 degrees, and drives back to its start in the end."
    " A wall is a duplicate where the map of any step holds it twice.",
    "fig11": "The drives of figure 10.",
    "eq4": "`wall` attaches r to the wall, `origin` to the world's origin, as the paper does. A ring of 40 m is driven"
    " twice, the second time 100 m away from the origin. A drive that broke down is left out.",
}


def read_rows(path: Path = ROWS) -> list[Row]:
    """Return all stored rows, of whatever code; the last of each figure and seed."""
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    return list({(row["figure"], row["seed"]): row for row in rows}.values())


def stale(rows: Iterable[Row]) -> list[str]:
    """Return the figures that some code has made that is not this."""
    return sorted({row["figure"] for row in rows if row["code"] != fingerprint()})


def page_of(rows: Sequence[Row], followed: Sequence[Row] = ()) -> str:
    """Return the whole page; `followed` are the drives by both followings."""
    parts = [HEAD]
    for name, own in _by_figure(rows).items():
        parts.append(f"## {_title(name)}\n")
        note = " ".join(filter(None, [NOTES.get(name, ""), strategies_in_words(followed) if name == "fig6" else ""]))
        parts += [f"{note}\n"] if note else []
        first, last = own[0]["seed"], own[-1]["seed"]
        parts.append(f"Drive of seed {first}.\n" if first == last else f"Drives of seeds {first} to {last}.\n")
        header, *lines = table_of([row["numbers"] for row in own], REPRODUCTIONS[name].paper)
        parts += map(_line, (header, ["---"] * len(header), *lines))
        parts.append("")
    return "\n".join([*parts, *following_section(followed)])


def tables_of(rows: Sequence[Row]) -> list[PageTable]:
    """Return the tables for a report."""
    found = []
    for name, own in _by_figure(rows).items():
        header, *lines = map(tuple, table_of([row["numbers"] for row in own], REPRODUCTIONS[name].paper))
        note = f"{NOTES.get(name, '')} {len(own)} drives: median, least and largest; of counts the mean."
        found.append(PageTable(_title(name), header, tuple(lines), note.strip()))
    return found


def _by_figure(rows: Iterable[Row]) -> dict[str, list[Row]]:
    """Return the rows of each figure that has any, by seed."""
    ordered = sorted(rows, key=lambda row: row["seed"])
    found = {name: [row for row in ordered if row["figure"] == name] for name in REPRODUCTIONS}
    return {name: own for name, own in found.items() if own}


def table_of(drives: Sequence[Mapping[str, Mapping[str, Value]]], paper: Mapping[str, Value]) -> list[list[str]]:
    """Return the header and a row for each quantity, with a column for the paper and for each back end."""
    names = list(drives[0])
    quantities = dict.fromkeys(key for drive in drives for name in names for key in drive[name])
    lines = [["quantity", *(["the paper"] if paper else []), *names]]
    for quantity in quantities:
        said = [str(paper.get(quantity, ""))] if paper else []
        lines.append([quantity, *said, *(cell([drive[name].get(quantity) for drive in drives]) for name in names)])
    return lines


def cell(values: Sequence[Value]) -> str:
    """Return one quantity over all drives in words; None counts as not measured."""
    there: list[Any] = [value for value in values if value is not None]
    lacking = f"; {len(values) - len(there)} without" if 0 < len(there) < len(values) else ""
    if not there:
        return "-"
    if all(isinstance(value, bool) for value in there):
        return f"{sum(there)} of {len(there)}{lacking}"
    if all(isinstance(value, str) for value in there):
        counts = Counter(there).most_common()
        return ("; ".join(f"{value} in {count}" for value, count in counts) if len(counts) > 1 else there[0]) + lacking
    middle = np.mean(there) if all(isinstance(value, int) for value in there) else np.median(there)
    if min(there) == max(there):
        return f"{there[0]:.3g}{lacking}"
    return f"{middle:.3g} ({min(there):.3g} to {max(there):.3g}){lacking}"


def write_page(rows: Sequence[Row], page: Path) -> None:
    """Write the page of the tables."""
    page.write_text(page_of(rows, read_following()))


def _title(name: str) -> str:
    title = {"table1": "Table 1", "eq4": "Equation 4", "standing": "Standing still"}.get(
        name, name.replace("fig", "Figure ")
    )
    return f"{title}: {REPRODUCTIONS[name].about}"


def _line(cells: Iterable[str]) -> str:
    return f"| {' | '.join(cells)} |"


def main() -> int:
    """Write the page, or say which of its tables are stale, and return the exit status."""
    rows = read_rows()
    if "--check" in sys.argv[1:]:
        old = stale(rows)
        print("stale: " + ", ".join(old) if old else "all tables of docs/paper.md are of this code")
        return int(bool(old))
    write_page(rows, PAGE)
    return 0


if __name__ == "__main__":
    sys.exit(main())
