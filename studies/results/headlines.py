"""The headline tables of the results: what was asked, from which rows, and what they answer."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from experiments.scoring.statistics import FEW_RUNS

from ..runner.rows import Row
from .figures import (
    closed_contours,
    completed,
    grouped,
    listed,
    mean_of,
    median_of,
    numbers,
    total,
    touches_of,
    typical,
)

STORED = Path("studies/results/rows")
Table = list[list[str]]


@dataclass(frozen=True)
class Found:
    """What rows came to."""

    table: Table
    """The first row holds the columns' names."""
    verdict: str


@dataclass(frozen=True)
class Headline:
    """One table of the page."""

    title: str
    aim: str
    command: str
    """What makes its rows."""
    rows: Path
    make: Callable[[Sequence[Row]], Found]


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
    errorless = rows[0]["errorless"]
    table: Table = [["world", "complete", "coverage: least", "contours closed", "path, mean"]]
    if not errorless:
        table[0] += ["pose ANEES: mean, median", "map ANEES: mean, median", "false matches"]
    for world, mine in grouped(rows, "world").items():
        cells = [f"`{world}`", completed(mine), f"{min(row['coverage'] for row in mine):.4f}", closed_contours(mine)]
        cells.append(f"{mean_of(mine, 'path_length_m'):.1f} m")
        if not errorless:
            cells += [
                typical(mine, "pose_anees"),
                typical(mine, "map_anees"),
                str(total(mine, "false_matches")),
            ]
        table.append(cells)
    verdict = f"{completed(rows)} complete, {closed_contours(rows)} contours closed, {touches_of(rows)}."
    if not errorless and min(map(len, grouped(rows, "world").values())) < FEW_RUNS:
        verdict += f" Fewer than {FEW_RUNS} runs a world: their ANEES decides nothing."
    return Found(table, verdict)


def apartments(rows: Sequence[Row]) -> Found:
    """Return what exploring apartments with noise came to."""
    coverage = [row["coverage"] for row in rows]
    crooked = typical(rows, "map_anees_straight")
    table: Table = [
        ["measure", "value"],
        ["complete", completed(rows)],
        ["coverage: mean, median, least", f"{np.mean(coverage):.4f}, {np.median(coverage):.4f}, {min(coverage):.3f}"],
        ["contours closed", closed_contours(rows)],
        ["false matches, duplicate walls", f"{total(rows, 'false_matches')}, {total(rows, 'duplicate_lines')}"],
        ["pose ANEES: mean, median", typical(rows, "pose_anees")],
        ["map ANEES: mean, median", typical(rows, "map_anees")],
        ["map ANEES without walls that the map calls crooked", crooked],
        ["planning, mean of a step", f"{mean_of(rows, 'planning_ms_mean'):.1f} ms"],
    ]
    verdict = f"Completion is reached: {completed(rows)}, {touches_of(rows)}. These maps are overconfident: some short "
    return Found(table, verdict + "lines take beams from several faces. Maps made since say so (next table).")


def real_plans(rows: Sequence[Row]) -> Found:
    """Return how sure each back end is of the same drives in apartments, by its own matches and by the true ones."""
    head = ["back end", "pose ANEES: mean, median", "map ANEES: mean, median", "intervals that hold the truth"]
    table: Table = [["matches", *head, "false matches", "duplicate walls"]]
    for stage in dict.fromkeys(row["stage"] for row in rows):
        for backend, mine in grouped([row for row in rows if row["stage"] == stage], "backend").items():
            pairs = np.array([row["pairs"] for row in mine])
            held = np.average([row["held"] or 0.0 for row in mine], weights=pairs) if pairs.any() else np.nan
            cells = [
                stage,
                f"`{backend}`",
                typical(mine, "pose_anees"),
                typical(mine, "map_anees"),
                f"{100 * held:.1f} %",
            ]
            table.append([*cells, *(f"{mean_of(mine, name):.2f}" for name in ("false_matches", "duplicate_lines"))])
    own = grouped([row for row in rows if row["stage"] == "own"], "backend")
    plans = len({row["world"] for row in rows})
    maps = ", ".join(f"`{name}` {mean_of(mine, 'map_anees'):.3g}" for name, mine in own.items())
    verdict = f"The mean map ANEES over {plans} apartments: {maps}. Intervals are too wide where faces are short"
    return Found(table, f"{verdict} ([limits](limits.md)).")


LOST = 3.0
"""A run whose mean NEES is this many times what the estimator expects no longer knows where it is."""


def schools(rows: Sequence[Row]) -> Found:
    """Return how eight back ends fare in schools over a limited number of steps."""
    head = ["back end", "runs", "exceptions", "pose ANEES: median", "map ANEES: median"]
    lost = f"lost: pose ANEES above {LOST:g}"
    table: Table = [[*head, lost, "coverage by then: mean", "false matches", "computing, mean of a step"]]
    maps = {name: float(np.median(numbers(mine, "map_anees"))) for name, mine in grouped(rows, "backend").items()}
    for backend, mine in grouped(rows, "backend").items():
        medians = [median_of(mine, name) for name in ("pose_anees", "map_anees")]
        own = mean_of(mine, "coverage_own_frame")
        failed = sum(bool(row["raised"]) for row in mine)
        cells = [f"`{backend}`", str(len(mine)), str(failed), *medians]
        cells.append(str(sum(value > LOST for value in numbers(mine, "pose_anees"))))
        took = f"{mean_of(mine, 'step_ms_mean'):.0f} ms"
        table.append([*cells, f"{own:.3f}", str(total(mine, "false_matches")), took])
    failed = sum(bool(row["raised"]) for row in rows)
    verdict = "No run ended by an exception." if not failed else f"{failed} runs ended by an exception."
    far = [value for value in maps.values() if value <= 10]
    verdict += f" All maps are overconfident: by {min(far):.1f} to {max(far):.1f} with the cross-correlations, and by "
    return Found(table, f"{verdict}{', '.join(f'{value:.0f}' for value in maps.values() if value > 10)} without them.")


def courts(rows: Sequence[Row]) -> Found:
    """Return what courts come to, where a robot begins without a wall in sight."""
    table: Table = [["court", "runs", "floor seen: least, mean", "coverage, own frame: mean", "collisions"]]
    for world, mine in grouped(rows, "world").items():
        swept = [row["swept"] for row in mine]
        own = f"{mean_of(mine, 'coverage_own_frame'):.3f}"
        cells = [f"`{world}`", str(len(mine)), f"{min(swept):.3f}, {np.mean(swept):.3f}", own]
        table.append([*cells, str(total(mine, "collisions"))])
    early = sum(row["status"] == "complete" and row["swept"] < 0.99 for row in rows)
    return Found(table, f"{early} of {len(rows)} runs ended too early. 3,000 steps do not finish such a building.")


def navigation(rows: Sequence[Row]) -> Found:
    """Return both navigations beside each other, over the plans that both have driven."""
    by = {name: {row["file"]: row for row in mine} for name, mine in grouped(rows, "navigation").items()}
    both = sorted(set.intersection(*(set(mine) for mine in by.values())))
    head = ["navigation", "runs", "complete", "path: sum", "steps: sum", "planning, mean of a step", "collisions"]
    table: Table = [head]
    for name, mine in by.items():
        pairs = [mine[file] for file in both]
        cells = [f"`{name}`", str(len(pairs)), completed(pairs), f"{total(pairs, 'path_length_m'):.0f} m"]
        planning = f"{mean_of(pairs, 'planning_ms_mean'):.1f} ms"
        table.append([*cells, str(total(pairs, "steps")), planning, str(total(pairs, "collisions"))])
    ratio = [by["visibility"][file]["path_length_m"] / by["floor"][file]["path_length_m"] for file in both]
    share = float(np.exp(np.mean(np.log(ratio))))
    return Found(
        table, f"Sequences of walls are {share:.2f} times as long as the way over the floor, and all complete."
    )


def paper_method(rows: Sequence[Row]) -> Found:
    """Return how often the paper's method enters a wall twice, beside today's mapper with two filters."""
    head = ["method", "runs", "with a wall entered twice", "walls entered twice", "pose ANEES: median"]
    table: Table = [[*head, "map ANEES: median"]]
    by = grouped(rows, "method")
    twice = {name: sum(row["duplicate_lines"] > 0 for row in mine) for name, mine in by.items()}
    for name, mine in by.items():
        cells = [f"`{name}`", str(len(mine)), f"{twice[name]} of {len(mine)}", str(total(mine, "duplicate_lines"))]
        table.append([*cells, median_of(mine, "pose_anees"), median_of(mine, "map_anees")])
    shares = ", ".join(f"`{name}` in {count} of {len(by[name])}" for name, count in twice.items())
    return Found(table, f"The wall entered twice appears, by {shares} runs ([why](exploration.md#the-papers-method)).")


HEADLINES = (
    Headline(
        "Do the stated intervals hold the truth?",
        "93 to 97 % of the 95 % intervals between corners hold the true distance (`paper-fig8`, closed loop, noise).",
        "make intervals",
        STORED / "intervals.jsonl",
        intervals,
    ),
    Headline(
        "The paper's two worlds, by four estimators on the same scans",
        "Pose and map ANEES near 1. [The paper's figures](paper.md) has every number.",
        "make paper",
        Path("studies/paper/rows.jsonl"),
        paper,
    ),
    Headline(
        "A wall entered twice, as in the paper's figure 9",
        "The paper's method enters a wall twice, or the reason why not (`paper-fig9`, the first 200 steps).",
        "python -m studies.consistency.paper_method --max-steps 200",
        STORED / "paper-method.jsonl",
        paper_method,
    ),
    Headline(
        "Bundled worlds, errorless",
        "All complete, coverage 1, every contour closed.",
        "python -m studies.exploration.suite --errorless",
        STORED / "bundled-errorless.jsonl",
        bundled,
    ),
    Headline(
        "Bundled worlds with noise",
        "All complete, ANEES near 1 (`full-ekf`).",
        "python -m studies.exploration.suite --seeds 2",
        STORED / "bundled-noisy.jsonl",
        bundled,
    ),
    Headline(
        "Apartments with noise",
        "95 % complete, mean coverage 0.99 (`invariant-ekf`, seed 1; the first of 160 apartments by name).",
        "python -m studies.exploration.suite --plans ../shared/data/plans --named 'lifull_*' --backend invariant-ekf",
        STORED / "apartments.jsonl",
        apartments,
    ),
    Headline(
        "The paper's question in real plans: six back ends on the same drives",
        "Map ANEES: median 0.9 to 1.15, mean below 1.5; pose ANEES 0.9 to 1.15; 93 to 97 % of the intervals hold.",
        "make real-plans",
        STORED / "real-plans.jsonl",
        real_plans,
    ),
    Headline(
        "Schools and offices, eight back ends",
        "No exception in 39 buildings of 1,500 noisy steps each, seed 1.",
        "make schools",
        STORED / "schools.jsonl",
        schools,
    ),
    Headline(
        "Courts: a start without a wall in sight",
        "No run ends before its floor is seen (`invariant-ekf`, 3,000 noisy steps, ten buildings, five seeds).",
        "make courts",
        STORED / "courts.jsonl",
        courts,
    ),
    Headline(
        "Navigation over the floor and by sequences of walls, apartments",
        "Both complete every apartment (errorless, `full-ekf`, seed 1).",
        "make navigation",
        STORED / "navigation.jsonl",
        navigation,
    ),
)
