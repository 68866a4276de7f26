"""Tables of results in the paper's and other bundled worlds."""

from collections.abc import Sequence

import numpy as np

from ..runner.rows import Row
from .figures import (
    Table,
    closed_contours,
    completed,
    false_matches,
    grouped,
    mean_of,
    median_of,
    numbers,
    pose_score,
    total,
    typical,
)


def intervals(rows: Sequence[Row]) -> Table:
    """Return which share of the stated intervals holds the truth, by back end and by run."""
    head = ["back end", "runs", "intervals that hold the truth", "runs below 80 %", "scatter by run, and expected"]
    table: Table = [[*head, "map ANEES: mean, median"]]
    for backend, mine in grouped(rows, "backend").items():
        held = np.array(numbers(mine, "held"))
        scatter = f"{100 * held.std():.1f} %, {100 * np.sqrt(np.mean(np.square(numbers(mine, 'expected_sd')))):.1f} %"
        cells = [f"`{backend}`", str(len(mine)), f"{100 * held.mean():.1f} %", str(int(np.sum(held < 0.8))), scatter]
        table.append([*cells, typical(mine, "map_anees")])
    return table


def bundled(rows: Sequence[Row]) -> Table:
    """Return completion, coverage and consistency of the bundled worlds, and of all together."""
    errorless, (words, pose) = rows[0]["errorless"], pose_score(rows)
    table: Table = [["world", "complete", "coverage: least", "contours closed", "path, mean", "collisions"]]
    if not errorless:
        table[0] += [
            f"{words}: mean, median",
            "map ANEES: mean, median",
            "false matches: of five beams or more, of fewer",
        ]
    worlds = {f"`{world}`": own for world, own in grouped(rows, "world").items()}
    for world, mine in {**worlds, "all": rows}.items():
        cells = [world, completed(mine), f"{min(row['coverage'] for row in mine):.4f}", closed_contours(mine)]
        cells += [f"{mean_of(mine, 'path_length_m'):.1f} m", str(total(mine, "collisions"))]
        if not errorless:
            cells += [
                typical(mine, pose),
                typical(mine, "map_anees"),
                f"{sum(false_matches(mine))}, {total(mine, 'false_matches_few_beams')}",
            ]
        table.append(cells)
    return table


def paper_method(rows: Sequence[Row]) -> Table:
    """Return how often the paper's method enters a duplicate wall, beside today's mapper with two filters."""
    words, pose = pose_score(rows)
    table: Table = [["method", "with a duplicate wall", "duplicate walls", f"{words}: median", "map ANEES: median"]]
    for name, mine in grouped(rows, "method").items():
        with_one = f"{sum(row['duplicate_lines'] > 0 for row in mine)} of {len(mine)}"
        cells = [f"`{name}`", with_one, str(total(mine, "duplicate_lines"))]
        table.append([*cells, median_of(mine, pose), median_of(mine, "map_anees")])
    return table
