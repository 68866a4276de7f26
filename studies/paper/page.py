"""Tables of the paper's figures, one for each, from the stored numbers of all drives."""

from collections import Counter
from collections.abc import Iterable, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.experiments.reproductions import REPRODUCTIONS
from chainslam.experiments.reproductions.reproduction import Value
from chainslam.viz.reports.report import PageTable

from ..runner.marks import short
from ..runner.rows import Row

ROWS = Path("studies/paper/rows.jsonl")
NAMES = ("figure", "seed")
FEW = 3
"""Of words that differ between drives, so many are told."""
NOTES = {
    "table1": "Lengths are in metres, as measured between mapped corners.",
    "fig4": "After exploration the robot drives to wall 8, and from there to wall 16 along the route that the graph"
    " plans. Walls have the paper's numbers; a wall without one stands in brackets. Open ends found on the way are"
    " explored first.",
    "fig5": "In the paper motion and perception are without error; here they have noise, one drive for each seed."
    " Sigmas are those of each back end on the same observations, with the true association.",
    "fig6": "As figure 5. The ratio is that of two drives with one seed.",
    "fig9": "A wall counts as a duplicate if the last map holds it twice."
    " `chainslam reproduce fig9` tries seeds until a duplicate wall lasts 30 steps, and marks it.",
    "fig10": "The start has an uncertainty of 0.1 m and 2 degrees, and the robot returns to it in the end."
    " A wall counts as a duplicate if the map of any step holds it twice.",
    "fig11": "The drives of figure 10.",
    "eq4": "`wall` anchors r at the wall, `origin` at the world's origin, as the paper does. A ring of 40 m is driven"
    " twice, the second time 100 m away from the origin. Drives that broke down are left out.",
}


def figures(rows: Sequence[Row]) -> Mapping[str, list[list[str]]]:
    """Return a table for each figure by what stands above it."""
    return {
        f"## {table.title}\n\n{table.note}": [list(table.header), *map(list, table.rows)] for table in tables_of(rows)
    }


def tables_of(rows: Iterable[Row]) -> list[PageTable]:
    """Return a table for each figure that has rows."""
    found, ordered = [], sorted(rows, key=lambda row: row["seed"])
    for name, entry in REPRODUCTIONS.items():
        if own := [row for row in ordered if row["figure"] == name]:
            header, *lines = map(tuple, table_of([row["numbers"] for row in own], entry.paper))
            note = f"{NOTES.get(name, '')} {len(own)} drives: median, least and largest; of counts the mean."
            found.append(PageTable(f"{_title(name)}: {entry.about}", header, tuple(lines), note.strip()))
    return found


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
        told = "; ".join(f"{value} in {count}" for value, count in counts) if len(counts) > 1 else there[0]
        return (told if len(counts) <= FEW else f"{len(counts)} different ones") + lacking
    middle = np.mean(there) if all(isinstance(value, int) for value in there) else np.median(there)
    if min(there) == max(there):
        return f"{short(there[0])}{lacking}"
    return f"{short(middle)} ({short(min(there))} to {short(max(there))}){lacking}"


def _title(name: str) -> str:
    return {"table1": "Table 1", "eq4": "Equation 4", "standing": "Standing still"}.get(
        name, name.replace("fig", "Figure ")
    )
