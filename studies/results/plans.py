"""Tables of results in real plans: apartments, schools, courts."""

from collections.abc import Callable, Mapping, Sequence

import numpy as np

from ..runner.rows import Row
from .figures import (
    Table,
    closed_contours,
    completed,
    false_matches,
    grouped,
    innovations,
    mean_of,
    median_of,
    numbers,
    pose_score,
    total,
    typical,
)

WRONG = "false matches of five beams or more"
NOISE = "NIS, scans in its band: the noise model is"
LOST = 3.0
"""A run whose mean NEES is this many times what the estimator expects no longer knows where it is."""


def apartments(rows: Sequence[Row]) -> Table:
    """Return what exploring apartments with noise came to, by back end."""
    by = grouped(rows, "backend")
    table: Table = [["measure", *(f"`{name}`" for name in by)]]
    words, pose = pose_score(rows)
    measures: dict[str, Callable[[Sequence[Row]], str]] = {
        "complete": completed,
        "coverage: mean, median, least": lambda mine: (
            f"{mean_of(mine, 'coverage'):.4f}, {median_of(mine, 'coverage', 4)}, {min(numbers(mine, 'coverage')):.3f}"
        ),
        "contours closed": closed_contours,
        "collisions": lambda mine: str(total(mine, "collisions")),
        f"{words}: mean, median": lambda mine: typical(mine, pose),
        "map ANEES: mean, median": lambda mine: typical(mine, "map_anees"),
        NOISE: innovations,
        "maps with an ANEES above 3": lambda mine: str(sum(value > LOST for value in numbers(mine, "map_anees"))),
        "false matches a plan: of five beams or more, of fewer": lambda mine: (
            f"{np.mean(false_matches(mine)):.2f}, {mean_of(mine, 'false_matches_few_beams'):.2f}"
        ),
        "duplicate walls a plan, false mergers in all": lambda mine: (
            f"{mean_of(mine, 'duplicate_lines'):.2f}, {total(mine, 'false_merges')}"
        ),
        "planning, mean of a step": lambda mine: f"{mean_of(mine, 'planning_ms_mean'):.1f} ms",
    }
    for words, figure in measures.items():
        table.append([words, *(figure(mine) for mine in by.values())])
    return table


def real_plans(rows: Sequence[Row]) -> Mapping[str, Table]:
    """Return how sure each back end is of the same drives in apartments, by its own matches and by the true ones.

    Rows of several versions of the code, of other apartments or other back ends, make a table each.
    """
    return {f"#### {_counted(own)}": _real_plans(own) for own in grouped(rows, "code").values()}


def _counted(rows: Sequence[Row]) -> str:
    plans, names = ({row[key] for row in rows} for key in ("world", "backend"))
    return f"{len(names)} back ends in {len(plans)} apartments"


def _real_plans(rows: Sequence[Row]) -> Table:
    words, pose = pose_score(rows)
    head = ["back end", f"{words}: mean, median", "map ANEES: mean, median", "intervals that hold the truth"]
    table: Table = [["matches", *head, WRONG, "duplicate walls", NOISE]]
    for stage in dict.fromkeys(row["stage"] for row in rows):
        for backend, mine in grouped([row for row in rows if row["stage"] == stage], "backend").items():
            pairs = np.array([row["pairs"] for row in mine])
            held = np.average([row["held"] or 0.0 for row in mine], weights=pairs) if pairs.any() else np.nan
            cells = [
                stage,
                f"`{backend}`",
                typical(mine, pose),
                typical(mine, "map_anees"),
                f"{100 * held:.1f} %",
            ]
            wrong = float(np.mean(false_matches(mine)))
            doubles = f"{mean_of(mine, 'duplicate_lines'):.2f}"
            table.append([*cells, f"{wrong:.2f}", doubles, innovations(mine)])
    return table


def schools(rows: Sequence[Row]) -> Table:
    """Return how back ends fare in schools over a limited number of steps, and which of them loses fewest maps."""
    words, pose = pose_score(rows)
    head = ["back end", "runs", "exceptions", f"{words}: median", "map ANEES: median"]
    lost = f"lost: pose ANEES above {LOST:g}"
    table: Table = [[*head, lost, "coverage by then: mean", f"{WRONG} a run", "collisions", NOISE]]
    for backend, mine in grouped(rows, "backend").items():
        medians = [median_of(mine, name) for name in (pose, "map_anees")]
        failed, gone = sum(bool(row["raised"]) for row in mine), sum(v > LOST for v in numbers(mine, "pose_anees"))
        cells = [f"`{backend}`", str(len(mine)), str(failed), *medians, str(gone)]
        covered, wrong = mean_of(mine, "coverage_own_frame"), np.mean(false_matches(mine))
        cells += [f"{covered:.3f}", f"{wrong:.1f}", str(total(mine, "collisions"))]
        table.append([*cells, innovations(mine)])
    return table


def whole_schools(rows: Sequence[Row]) -> Table:
    """Return what exploring schools to their end came to, by back end."""
    words, pose = pose_score(rows)
    head = ["back end", "complete", "coverage: mean, least", "own frame: mean", f"{words}: median"]
    table: Table = [[*head, "map ANEES: mean, median", f"{WRONG} a run", "steps: mean", "collisions", NOISE]]
    for backend, mine in grouped(rows, "backend").items():
        coverage = numbers(mine, "coverage")
        cells = [f"`{backend}`", completed(mine), f"{np.mean(coverage):.4f}, {min(coverage):.3f}"]
        cells += [f"{mean_of(mine, 'coverage_own_frame'):.4f}", median_of(mine, pose)]
        cells += [typical(mine, "map_anees"), f"{np.mean(false_matches(mine)):.1f}", f"{mean_of(mine, 'steps'):.0f}"]
        table.append([*cells, str(total(mine, "collisions")), innovations(mine)])
    return table


def courts(rows: Sequence[Row]) -> Table:
    """Return what courts come to, where a robot begins without a wall in sight."""
    head = ["court", "runs", "complete", "floor seen: least, mean", "coverage, own frame: mean", "collisions"]
    table: Table = [head]
    for world, mine in grouped(rows, "world").items():
        swept = [row["swept"] for row in mine]
        own = f"{mean_of(mine, 'coverage_own_frame'):.3f}"
        cells = [f"`{world}`", str(len(mine)), completed(mine), f"{min(swept):.3f}, {np.mean(swept):.3f}", own]
        table.append([*cells, str(total(mine, "collisions"))])
    return table


def navigation(rows: Sequence[Row]) -> Table:
    """Return both navigations beside each other, over the plans that both have driven."""
    by = {name: {row["file"]: row for row in mine} for name, mine in grouped(rows, "navigation").items()}
    both = sorted(set.intersection(*(set(mine) for mine in by.values())))
    head = ["navigation", "complete", "path: sum", "over that over the floor", "steps: sum"]
    table: Table = [[*head, "planning, mean of a step", "collisions"]]
    for name, mine in by.items():
        pairs = [mine[file] for file in both]
        logs = [np.log(row["path_length_m"] / by["floor"][row["file"]]["path_length_m"]) for row in pairs]
        cells = [
            f"`{name}`",
            completed(pairs),
            f"{total(pairs, 'path_length_m'):.0f} m",
            f"{np.exp(np.mean(logs)):.2f}",
        ]
        planning = f"{mean_of(pairs, 'planning_ms_mean'):.1f} ms"
        table.append([*cells, str(total(pairs, "steps")), planning, str(total(pairs, "collisions"))])
    return table
