"""The tables of both followings, and what they say in words, from the rows that `studies.paper.following` stored."""

import json
from collections.abc import Callable, Iterable, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import stats

from ..runner.rows import Row
from .following import BACKENDS, BY_BACKEND, BY_METHOD, COMPARED, DRIVING, FIGURES, ROWS, STRATEGIES

PAPER_SAID = {("fig8", "path, m"): "33", ("fig9", "first chain closed after, m"): "16 (around the obstacle)"}
WAYS = ("paper", "viewpoints")
FEWEST = 5
"""An interval of fewer values is not told."""


def read_following(path: Path = ROWS) -> list[Row]:
    """Return all stored rows, of whatever code; the last of each run."""
    rows = [json.loads(line) for line in path.read_text().splitlines()] if path.exists() else []
    names = ("part", "figure", "following", "strategy", "backend", "errorless", "seed")
    return list({tuple(row[name] for name in names): row for row in rows}.values())


def following_section(rows: Sequence[Row]) -> list[str]:
    """Return the lines of the section: the figures by both followings, then what the shortcut costs with each."""
    figures = [row for row in rows if row["part"] == BY_METHOD]
    beside = [row for row in rows if row["part"] == BY_BACKEND]
    return [*_figures(figures), *_shortcut(beside)] if figures and beside else []


def strategies_in_words(rows: Sequence[Row]) -> str:
    """Return how far the two strategies of figures 5 and 6 drive without errors, from the stored rows."""
    of = {
        row["figure"]: row
        for row in rows
        if row["part"] == BY_METHOD and row["errorless"] and row["following"] == "paper"
    }
    if not {"fig5", "fig6"} <= of.keys():
        return ""
    near, far = of["fig5"], of["fig6"]
    ratio = far["path_length_m"] / near["path_length_m"]
    return (
        f"Without noise, as in the paper, the robot drives {near['path_length_m']:.1f} m by the strategy of figure 5"
        f" and {far['path_length_m']:.1f} m by that of figure 6, {ratio:.2f} times as far; it passes the start"
        f" {_times(near['start_passes'])} and {_times(far['start_passes'])}."
    )


def _times(count: int) -> str:
    return "once" if count == 1 else f"{count} times"


def _figures(rows: Sequence[Row]) -> list[str]:
    seeds = sorted({row["seed"] for row in rows if not row["errorless"]})
    lines = [
        "## Both followings",
        "",
        "`--following paper` is the wall following of section 3.1: approach a wall, follow it, drive round its end,"
        " turn back. `viewpoints`, the default of this software, drives to where an open end can be seen. Otherwise"
        " both drives are those of `--preset paper-method`. Cells hold the median of seeds"
        f" {seeds[0]} to {seeds[-1]} with its range, and after a semicolon the drive without errors; counts of steps"
        " are means.",
        "",
        "| figure | quantity | the paper | paper's following | viewpoints |",
        "| --- | --- | --- | --- | --- |",
    ]
    for figure in FIGURES:
        for quantity, of in _QUANTITIES.items():
            cells = [_both([r for r in rows if (r["figure"], r["following"]) == (figure, way)], of) for way in WAYS]
            said = PAPER_SAID.get((figure, quantity), "")
            lines.append(f"| {figure} | {quantity} | {said} | {' | '.join(cells)} |")
    ratios = [_ratio(rows, way) for way in WAYS]
    lines.append(f"| fig6 / fig5 | path over that of figure 5 | about 3 | {' | '.join(ratios)} |")
    return [*lines, "", _why_shorter(rows), ""]


def _both(rows: Sequence[Row], of: Callable[[Sequence[Row]], str]) -> str:
    noisy, exact = ([row for row in rows if row["errorless"] is errorless] for errorless in (False, True))
    return f"{of(noisy)}; {of(exact)}"


def _median(name: str) -> Callable[[Sequence[Row]], str]:
    def of(rows: Sequence[Row]) -> str:
        return _cell([row[name] for row in rows if row.get(name) is not None])

    return of


def _cell(values: Sequence[float]) -> str:
    if not values:
        return "-"
    if min(values) == max(values):
        return f"{values[0]:.3g}"
    return f"{np.median(values):.3g} ({min(values):.3g} to {max(values):.3g})"


def _spent(rows: Sequence[Row]) -> str:
    return ", ".join(f"{np.mean([row['behaviours'].get(word, 0) for row in rows]):.0f}" for word in DRIVING)


_QUANTITIES: dict[str, Callable[[Sequence[Row]], str]] = {
    "complete": lambda rows: f"{sum(row['status'] == 'complete' for row in rows)} of {len(rows)}",
    "contours closed": lambda rows: (
        f"{sum(row['contours_closed'] or 0 for row in rows)} of {sum(row['contours_reachable'] or 0 for row in rows)}"
    ),
    "path, m": _median("path_length_m"),
    "first chain closed after, m": _median("first_closed_m"),
    "steps: approach, follow, round, reverse": _spent,
    "longest route of walls": lambda rows: f"{max(row['longest_route'] for row in rows)}",
    "coverage": _median("coverage"),
    "duplicate walls": lambda rows: f"{sum(row['duplicate_lines'] or 0 for row in rows)}",
    "collisions": lambda rows: f"{sum(row['collisions'] or 0 for row in rows)}",
}


def _ratio(rows: Sequence[Row], way: str) -> str:
    def paths(figure: str, errorless: bool) -> dict[int, float]:
        return {
            row["seed"]: row["path_length_m"]
            for row in rows
            if (row["figure"], row["following"], row["errorless"]) == (figure, way, errorless)
        }

    told = []
    for errorless in (False, True):
        near, far = paths("fig5", errorless), paths("fig6", errorless)
        told.append(_cell([far[seed] / near[seed] for seed in near if seed in far]))
    return "; ".join(told)


def _why_shorter(rows: Sequence[Row]) -> str:
    """Say, from the rows, why the path in figure 8 is shorter than the paper's."""
    own = [r for r in rows if (r["figure"], r["following"], r["errorless"]) == ("fig8", "paper", False)]
    path = float(np.median([row["path_length_m"] for row in own]))
    turned = sum(row["behaviours"].get("reverse", 0) > 0 for row in own)
    return (
        f"In figure 8 the paper's robot drove 33 m, ours {path:.1f} m by the same rules. A wall is abandoned as soon as"
        " its chain goes on, and this scanner shows the next wall before the robot has come to the end of the present"
        f" one: it turned back along a wall in {turned} of {len(own)} drives. The paper does not say how soon its robot"
        " saw that; its extraction, its start and the clutter of its room are not known."
    )


def _shortcut(rows: Sequence[Row]) -> list[str]:
    seeds = len({row["seed"] for row in rows})
    lines = [
        "### Does following closer to the paper change what the shortcut costs?",
        "",
        f"Today's mapper in the same worlds, three strategies, {seeds} seeds: medians of the pose ANEES, of the map"
        " ANEES and of the path in metres, and the sum of duplicate walls.",
        "",
        "| figure | following | strategy | " + " | ".join(f"{name}: pose, map, m, twice" for name in BACKENDS) + " |",
        "| --- | --- | --- |" + " --- |" * len(BACKENDS),
    ]
    for figure in COMPARED:
        for way in WAYS:
            for strategy in STRATEGIES:
                cells = []
                for backend in BACKENDS:
                    own = _of(rows, figure=figure, following=way, strategy=strategy, backend=backend)
                    values = [_middle(own, name) for name in ("pose_anees", "map_anees", "path_length_m")]
                    cells.append(f"{', '.join(values)}, {sum(row['duplicate_lines'] or 0 for row in own)}")
                lines.append(f"| {figure} | {way} | {strategy} | {' | '.join(cells)} |")
    return [*lines, "", _answer(rows), ""]


def _of(rows: Iterable[Row], **named: Any) -> list[Row]:
    return [row for row in rows if all(row[name] == value for name, value in named.items())]


def _middle(rows: Sequence[Row], name: str) -> str:
    values = [row[name] for row in rows if row.get(name) is not None]
    return f"{np.median(values):.3g}" if values else "-"


def _answer(rows: Sequence[Row]) -> str:
    """Say by how much `block-ekf` multiplies each score of `full-ekf`, and whether that differs between followings."""
    words = []
    for name, said in (("pose_anees", "pose ANEES"), ("map_anees", "map ANEES")):
        costs = {way: _costs(rows, name, way) for way in WAYS}
        told = ", ".join(f"{_interval(costs[way])} by {_words(way)}" for way in WAYS)
        difference = _interval(costs["paper"] - costs["viewpoints"])
        verdict = "changes" if _is_sure(costs["paper"] - costs["viewpoints"]) else "is not shown to change"
        words.append(
            f"The shortcut multiplies the {said} by {told}; the first over the second is {difference}, so the following"
            f" {verdict} what it costs."
        )
    count = len(_costs(rows, "pose_anees", "paper"))
    return " ".join(
        [
            *words,
            "These are geometric means of `block-ekf` over `full-ekf` in drives of one world and seed, averaged over"
            f" the strategies, with 95 % t intervals over the {count} pairs of world and seed. Two scores were"
            " compared, and the verdicts are corrected for that (Bonferroni).",
        ]
    )


def _words(way: str) -> str:
    return "the paper's following" if way == "paper" else "viewpoints"


def _costs(rows: Sequence[Row], name: str, way: str) -> Float[np.ndarray, " n"]:
    """Return log(block-ekf / full-ekf) of a score for each world and seed, the mean over strategies."""
    found = []
    for figure in COMPARED:
        for seed in sorted({row["seed"] for row in rows}):
            own = _of(rows, figure=figure, following=way, seed=seed)
            value = {(row["strategy"], row["backend"]): row[name] for row in own}
            logs = [np.log(value[s, "block-ekf"] / value[s, "full-ekf"]) for s in STRATEGIES]
            found.append(float(np.mean(logs)))
    return np.array(found)


def _interval(logs: Float[np.ndarray, " n"]) -> str:
    middle = np.exp(logs.mean())
    if len(logs) < FEWEST:
        return f"{middle:.3g}"
    low, high = np.exp(stats.t.interval(0.95, len(logs) - 1, logs.mean(), stats.sem(logs)))
    return f"{middle:.3g} ({low:.3g} to {high:.3g})"


def _is_sure(logs: Float[np.ndarray, " n"]) -> bool:
    return len(logs) >= FEWEST and bool(stats.ttest_1samp(logs, 0.0).pvalue < 0.05 / 2)
