"""The short tables of docs/benchmarks.md and of the README; the full ones stand with the contributors' pages."""

from collections.abc import Sequence

import numpy as np

from chainslam.experiments.campaign.comparison import benchmark
from chainslam.experiments.reproductions import REPRODUCTIONS

from ..paper.page import cell
from ..robots.faults import SOUND, by_case
from ..runner.marks import short
from ..runner.rows import Row
from .figures import (
    Table,
    closed_contours,
    completed,
    grouped,
    mean_of,
    median_of,
    numbers,
    pose_score,
    total,
)
from .plans import LOST
from .rivals import WHOLE, by_backend, by_place, ratios

QUOTED = {
    ("fig8", "path, m"): "figure 8: path, m",
    ("fig8", "error of named corners' distances, worst, cm"): "figure 8: worst error between corners, cm",
    ("fig9", "first chain closed after, m"): "figure 9: first chain closed after, m",
    ("fig9", "duplicate walls"): "figure 9: duplicate walls",
    ("fig9", "pose ANEES (1 is ideal)"): "figure 9: pose ANEES",
    ("fig6", "path over that of figure 5"): "figure 6: path over that of figure 5",
    ("fig10", "least trace over the start's"): "figure 10: least trace of the pose covariance over the start's",
}
"""Figures and quantities that the page quotes, and its words for them."""
ESTIMATORS = "block-ekf", "full-ekf"
PLACE, LEFT_OUT = "apartments", "ring of 60 m"
ALIKE = "relocation-ekf", "iterated-ekf", "oc-ekf", "joint-block-ekf"
"""Variants that lie close to a back end that the page shows; all results have them."""
RANKED = "estimator", "pose ANEES", "path error, cm", "closed: complete"
"""Columns of the leaderboard that the page shows."""
SHOWN = "block-ekf", "full-ekf", "invariant-ekf", "graph"
EXPLORER, LOG = "invariant-ekf", "intel"
"""What the README shows: the place, the back ends in it, who explores, and a log; and a place between two others."""
ANEES = "pose_anees", "map_anees"
LOGS = {"intel": "Intel", "aces": "ACES", "seattle": "Seattle"}


def estimators(rows: Sequence[Row]) -> Table:
    """Return the mean pose and map ANEES of each back end in each place, and its precision beside the baseline's."""
    places = {name: there for name, there in by_place(rows).items() if not name.startswith(LEFT_OUT)}
    table: Table = [["back end", *places, f"error, stated sigma over those of `{WHOLE}`"]]
    by = by_backend(rows)
    for name, mine in by.items():
        if name in ALIKE:
            continue
        own = ([row for row in there if row["backend"] == name] for there in places.values())
        scores = (
            ", ".join(short(mean_of(each, score)) for score in ("pose_anees_from_start", "map_anees")) for each in own
        )
        table.append([f"`{name}`", *scores, ratios(mine, by[WHOLE])])
    return table


def leaderboard(rows: Sequence[Row]) -> Table:
    """Return the columns of the leaderboard by which estimators are ranked and known to finish."""
    head, *lines = benchmark.table(rows)
    kept = [head.index(name) for name in RANKED]
    return [[line[column] for column in kept] for line in (head, *lines)]


def exploration(rows: Sequence[Row]) -> Table:
    """Return how many buildings of each kind each back end completes, and how consistent it is then."""
    words, pose = pose_score(rows)
    head = ["buildings", "back end", "complete", "coverage: mean, least", "contours closed", "collisions"]
    table: Table = [[*head, f"{words}, median", f"lost: above {LOST:g}", "map ANEES, median"]]
    for kind, there in grouped([{"kind": kind_of(row)} | row for row in rows], "kind").items():
        for name, mine in grouped(there, "backend").items():
            coverage = numbers(mine, "coverage_own_frame")
            cells = [
                f"{len(mine)} {kind}",
                f"`{name}`",
                completed(mine),
                f"{np.mean(coverage):.3f}, {min(coverage):.3f}",
            ]
            cells += [closed_contours(mine), str(total(mine, "collisions")), median_of(mine, pose)]
            lost = str(sum(value > LOST for value in numbers(mine, pose)))
            table.append([*cells, lost, median_of(mine, "map_anees")])
    return table


def kind_of(row: Row) -> str:
    """Return which kind of building a row is of."""
    if row["file"].startswith("lifull"):
        return "apartments"
    if row["file"].startswith("cml"):
        return "schools, first 1,500 steps" if row["max_steps"] == 1500 else "schools"
    return "bundled worlds"


def figures(rows: Sequence[Row]) -> Table:
    """Return what the paper says of its figures and what two back ends have there: median, least and largest."""
    table: Table = [["quantity", "the paper", *(f"`{name}`" for name in ESTIMATORS)]]
    for (figure, quantity), words in QUOTED.items():
        drives = [row["numbers"] for row in rows if row["figure"] == figure]
        values = (cell([drive.get(name, {}).get(quantity) for drive in drives]) for name in ESTIMATORS)
        table.append([words, str(REPRODUCTIONS[figure].paper.get(quantity, "")), *values])
    return table


def logs(rows: Sequence[Row]) -> Table:
    """Return how far each back end is at each step from what others measured."""
    table: Table = [
        ["", "Intel: error of relations, m", *(f"{name}: error rms, m; normalised" for name in LOGS.values())]
    ]
    whole = [row for row in rows if row["every"] == 1 and row["odometry"] == "scans"]
    for name, mine in grouped(whole, "backend").items():
        table.append([f"`{name}`", *_errors({row["log"]: row for row in mine})])
    return table


def _errors(by_log: dict[str, Row]) -> list[str]:
    relations = by_log.get("intel", {}).get("relations")
    cells = ["-" if relations is None else f"{relations['at_scans']['all']['translation_m']['mean']:.3f}"]
    for name in LOGS:
        row = by_log.get(name, {})
        error, honest = row.get("reference"), row.get("reference_normalised")
        told = f"{error['ate_aligned_m']:.3f}" if error else "-"
        cells.append(told + (f"; {short(honest['all']['median'])}" if honest else ""))
    return cells


def endings(rows: Sequence[Row]) -> Table:
    """Return how the runs with each fault end, and the worst of their scores; faults that cost nothing share a row."""
    table: Table = [["fault", "ends as", "coverage, least", "pose ANEES, worst", "map ANEES, worst"]]
    cases = by_case(rows)
    others = [case for case, mine in cases.items() if case != SOUND and _cost_nothing(mine)]
    shown = {case: mine for case, mine in cases.items() if case not in others}
    if others:
        shown[f"{len(others)} others"] = [row for case in others for row in cases[case]]
    for case, mine in shown.items():
        worst = (short(max(numbers(mine, name))) for name in ANEES)
        failed = max((row["steps"] for row in mine if row["status"] == "failed"), default=0)
        ends = (f"failed by step {failed}" if end == "failed" else end for end in sorted({r["status"] for r in mine}))
        table.append([case, ", ".join(ends), f"{min(numbers(mine, 'coverage')):.2f}", *worst])
    return table


def _cost_nothing(rows: Sequence[Row]) -> bool:
    sure = all(value <= LOST for name in ANEES for value in numbers(rows, name))
    return sure and all(row["status"] == "complete" for row in rows)


def speed(rows: Sequence[Row]) -> Table:
    """Return the processor time of a step, and how much faster than the robot the program is."""
    table: Table = [["task", "back end", "a step, ms: mean", "95 % of them below, ms", "times real time"]]
    for kind, there in grouped([{"kind": kind_of(row)} | row for row in rows], "kind").items():
        for name, mine in grouped(there, "backend").items():
            cells = [kind, f"`{name}`", f"{mean_of(mine, 'step_ms_mean'):.1f}"]
            faster = sum(numbers(mine, "drive_time_s")) / sum(numbers(mine, "processor_s"))
            table.append([*cells, f"{mean_of(mine, 'step_ms_p95'):.1f}", f"{faster:.0f}"])
    return table


def headlines(rows: Sequence[Row]) -> Table:
    """Return what is measured and what came out: rows of rivals, of explored apartments and of logs together."""
    rivals = [row for row in rows if "place" in row]
    place, there = next((name, mine) for name, mine in by_place(rivals).items() if name.startswith(PLACE))
    by_name = {name: [row for row in there if row["backend"] == name] for name in SHOWN}
    driven = [row for row in rows if "file" in row and kind_of(row) == "apartments" and row["backend"] == EXPLORER]
    log = next(row for row in rows if row.get("log") == LOG and row["every"] == 1 and row["odometry"] == "scans")
    refined = log["relations_smoothed"]["at_scans"]["all"]["translation_m"]["mean"]
    return [
        ["measured", "result"],
        [f"pose ANEES, identical observations in {place} (1 is ideal)", _scores(by_name, "pose_anees_from_start")],
        ["map ANEES there", _scores(by_name, "map_anees")],
        [
            f"{len(driven)} apartments explored with noise by `{EXPLORER}`",
            f"{completed(driven)} complete, {total(driven, 'collisions')} collisions,"
            f" {100 * np.mean(numbers(driven, 'coverage_own_frame')):.1f} % of the walls mapped",
        ],
        ["log of the Intel lab, after offline refinement", f"{refined:.3f} m mean error of the published relations"],
        [
            "processor time from scan to motion command",
            f"{mean_of(driven, 'step_ms_mean'):.1f} ms on one core of a busy machine",
        ],
    ]


def _scores(by_name: dict[str, list[Row]], score: str) -> str:
    return ", ".join(f"`{name}` {short(mean_of(mine, score))}" for name, mine in by_name.items())
