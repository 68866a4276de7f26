"""Tables of results in the paper's and other bundled worlds."""

from collections.abc import Sequence

import numpy as np

from chainslam.experiments.scoring.statistics import FEW_RUNS

from ..runner.rows import Row
from .figures import (
    Found,
    Table,
    closed_contours,
    completed,
    false_matches,
    grouped,
    listed,
    mean_of,
    median_of,
    numbers,
    pose_score,
    total,
    touches_of,
    typical,
)


def intervals(rows: Sequence[Row]) -> Found:
    """Return which share of the stated intervals holds the truth, by back end and by run."""
    head = ["back end", "runs", "intervals that hold the truth", "runs below 80 %", "scatter by run, and expected"]
    table: Table = [[*head, "map ANEES: mean, median"]]
    shares = {}
    for backend, mine in grouped(rows, "backend").items():
        shares[backend] = 100 * mean_of(mine, "held")
        held = np.array(numbers(mine, "held"))
        scatter = f"{100 * held.std():.1f} %, {100 * np.sqrt(np.mean(np.square(numbers(mine, 'expected_sd')))):.1f} %"
        cells = [f"`{backend}`", str(len(mine)), f"{shares[backend]:.1f} %", str(int(np.sum(held < 0.8))), scatter]
        table.append([*cells, typical(mine, "map_anees")])
    within = listed([name for name, share in shares.items() if 93 <= share <= 97])
    beyond = listed([f"{name} ({share:.1f} %)" for name, share in shares.items() if not 93 <= share <= 97])
    return Found(table, f"Reached by {within}. Missed by {beyond}.")


def paper(rows: Sequence[Row]) -> Found:
    """Return the pose's ANEES in the paper's two noisy worlds, and its distances, by back end."""
    names = list(rows[0]["numbers"])
    table: Table = [["", *(f"`{name}`" for name in names)]]
    for figure, words in (("fig8", "figure 8"), ("fig9", "figure 9")):
        found = [row["numbers"] for row in rows if row["figure"] == figure]
        for score in ("pose ANEES (1 is ideal)", "map ANEES (1 is ideal)"):
            medians = [float(np.median([numbers[name][score] for numbers in found])) for name in names]
            kind = score.partition(" (")[0]
            table.append([f"{words}, {len(found)} drives: {kind}, median", *(f"{value:.3g}" for value in medians)])
    held = {name: [0, 0] for name in names}
    for row in rows:
        if row["figure"] == "table1":
            for name in names:
                inside = [value for key, value in row["numbers"][name].items() if key.endswith("in its interval")]
                held[name][0] += sum(inside)
                held[name][1] += len(inside)
    table.append(["Table 1: distances inside their 95 % interval", *(f"{a} of {b}" for a, b in held.values())])
    scores = {
        name: [r["numbers"][name]["pose ANEES (1 is ideal)"] for r in rows if r["figure"] in ("fig8", "fig9")]
        for name in names
    }
    others = max(value for name in names[1:] for value in scores[name])
    verdict = (
        f"The pose ANEES of `{names[0]}` is {min(scores[names[0]]):.0f} or more in every drive. Of the others the "
    )
    return Found(table, f"{verdict}largest in any drive is {others:.1f}, and their medians are near 1.")


def bundled(rows: Sequence[Row]) -> Found:
    """Return completion, coverage and consistency of the bundled worlds."""
    errorless, (words, pose) = rows[0]["errorless"], pose_score(rows)
    table: Table = [["world", "complete", "coverage: least", "contours closed", "path, mean"]]
    if not errorless:
        table[0] += [
            f"{words}: mean, median",
            "map ANEES: mean, median",
            "false matches: of five beams or more, of fewer",
        ]
    for world, mine in grouped(rows, "world").items():
        cells = [f"`{world}`", completed(mine), f"{min(row['coverage'] for row in mine):.4f}", closed_contours(mine)]
        cells.append(f"{mean_of(mine, 'path_length_m'):.1f} m")
        if not errorless:
            cells += [
                typical(mine, pose),
                typical(mine, "map_anees"),
                f"{sum(false_matches(mine))}, {total(mine, 'false_matches_few_beams')}",
            ]
        table.append(cells)
    verdict = f"{completed(rows)} complete, {closed_contours(rows)} contours closed, {touches_of(rows)}."
    if not errorless and min(map(len, grouped(rows, "world").values())) < FEW_RUNS:
        verdict += f" Fewer than {FEW_RUNS} runs a world: their ANEES decides nothing."
    return Found(table, verdict)


def paper_method(rows: Sequence[Row]) -> Found:
    """Return how often the paper's method enters a duplicate wall, beside today's mapper with two filters."""
    words, pose = pose_score(rows)
    head = ["method", "runs", "with a duplicate wall", "duplicate walls", f"{words}: median"]
    table: Table = [[*head, "map ANEES: median"]]
    by = grouped(rows, "method")
    twice = {name: sum(row["duplicate_lines"] > 0 for row in mine) for name, mine in by.items()}
    for name, mine in by.items():
        cells = [f"`{name}`", str(len(mine)), f"{twice[name]} of {len(mine)}", str(total(mine, "duplicate_lines"))]
        table.append([*cells, median_of(mine, pose), median_of(mine, "map_anees")])
    shares = "; ".join(f"`{name}` in {count} of {len(by[name])}" for name, count in twice.items())
    return Found(table, f"The duplicate wall appears, by {shares} runs ([why](exploration.md#the-papers-method)).")
