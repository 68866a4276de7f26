"""The tables of both followings, from the rows that `studies.paper.following` stored."""

from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np
from jaxtyping import Float
from scipy import stats

from ..runner.rows import Row
from .following import BACKENDS, BY_BACKEND, BY_METHOD, COMPARED, DRIVING, FIGURES, STRATEGIES

PAPER_SAID = {("fig8", "path, m"): "33", ("fig9", "first chain closed after, m"): "16 (around the obstacle)"}
WAYS = {"paper": "paper's following", "viewpoints": "viewpoints"}
FEWEST = 5
"""An interval of fewer values is not told."""
SCORES = {"pose_anees": "pose ANEES", "map_anees": "map ANEES"}
Table = list[list[str]]


def figures(rows: Sequence[Row]) -> Table:
    """Return each figure by both followings: with noise, and after a semicolon without errors."""
    rows = _of(rows, part=BY_METHOD)
    table = [["figure", "quantity", "the paper", *WAYS.values()]]
    for figure in FIGURES:
        for quantity, of in _QUANTITIES.items():
            cells = [_both(_of(rows, figure=figure, following=way), of) for way in WAYS]
            table.append([figure, quantity, PAPER_SAID.get((figure, quantity), ""), *cells])
    return [*table, ["fig6 / fig5", "path over that of figure 5", "about 3", *(_ratio(rows, way) for way in WAYS)]]


def _both(rows: Sequence[Row], of: Callable[[Sequence[Row]], str]) -> str:
    return "; ".join(of(_of(rows, errorless=errorless)) for errorless in (False, True))


def _median(name: str) -> Callable[[Sequence[Row]], str]:
    return lambda rows: _cell([row[name] for row in rows if row.get(name) is not None])


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
    told = []
    for errorless in (False, True):
        near, far = (
            {row["seed"]: row["path_length_m"] for row in _of(rows, figure=name, following=way, errorless=errorless)}
            for name in ("fig5", "fig6")
        )
        told.append(_cell([far[seed] / near[seed] for seed in near if seed in far]))
    return "; ".join(told)


def costs(rows: Sequence[Row]) -> Mapping[str, Table]:
    """Return the scores of each back end by following, and by how much the shortcut multiplies them with each."""
    rows = _of(rows, part=BY_BACKEND)
    seeds = len({row["seed"] for row in rows})
    head = [f"{name}: pose ANEES, map ANEES, path in m, duplicate walls" for name in BACKENDS]
    table = [["figure", "following", "strategy", *head]]
    for figure in COMPARED:
        for way in WAYS:
            for strategy in STRATEGIES:
                cells = []
                for backend in BACKENDS:
                    own = _of(rows, figure=figure, following=way, strategy=strategy, backend=backend)
                    values = [_middle(own, name) for name in ("pose_anees", "map_anees", "path_length_m")]
                    cells.append(f"{', '.join(values)}, {sum(row['duplicate_lines'] or 0 for row in own)}")
                table.append([figure, way, strategy, *cells])
    return {
        f"Medians over {seeds} seeds; duplicate walls are summed.": table,
        "The factor from `full-ekf` to `block-ekf`, with its interval, and how much larger it is with the paper's"
        " following:": [["score", *WAYS.values(), "the first over the second"], *map(_factors(rows), SCORES)],
    }


def _of(rows: Iterable[Row], **named: Any) -> list[Row]:
    return [row for row in rows if all(row[name] == value for name, value in named.items())]


def _middle(rows: Sequence[Row], name: str) -> str:
    values = [row[name] for row in rows if row.get(name) is not None]
    return f"{np.median(values):.3g}" if values else "-"


def _factors(rows: Sequence[Row]) -> Callable[[str], list[str]]:
    def of(name: str) -> list[str]:
        paper, viewpoints = (_costs(rows, name, way) for way in WAYS)
        # Two scores are compared: intervals of both comparisons together hold in 95 of 100 cases (Bonferroni).
        factors = _interval(paper), _interval(viewpoints), _interval(paper - viewpoints, 1 - 0.05 / len(SCORES))
        return [SCORES[name], *factors]

    return of


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


def _interval(logs: Float[np.ndarray, " n"], level: float = 0.95) -> str:
    middle = np.exp(logs.mean())
    if len(logs) < FEWEST:
        return f"{middle:.3g}"
    low, high = np.exp(stats.t.interval(level, len(logs) - 1, logs.mean(), stats.sem(logs)))
    return f"{middle:.3g} ({low:.3g} to {high:.3g})"
