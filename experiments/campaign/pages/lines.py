"""The findings of a campaign: which estimators are consistent, what the others cost, which strategy is cheaper."""

from collections.abc import Sequence
from typing import Any

from ...scoring.statistics import FEW_RUNS
from ...views.numbers import estimated, listed, number
from ..comparison.comparison import BASELINE_BACKEND, BASELINE_STRATEGY
from ..comparison.consistency import CAUTIOUS, CONSISTENT, OVERCONFIDENT, TOO_FEW, in_words
from ..plan import CLOSED, RIDES, Campaign, is_errorless

Row = dict[str, Any]


def lines_of(campaign: Campaign, said: Row) -> tuple[str, ...]:
    """Return the lines, four at most, from the campaign's `comparison.json`."""
    external = dict(campaign.external)
    rows = [row for row in said["pooled"] if row["arm"] == deciding_arm(campaign) and row["backend"] not in external]
    if is_errorless(campaign):
        runs = (f"{row['backend']} completes {row['complete']} of {row['trials']} runs" for row in rows)
        return (f"Without noise, {listed(tuple(runs))}.",)
    judged = (_consistent(rows),) if rows else ()
    return (*judged, *_rides(campaign, said), *_costs(campaign, said, rows), *_strategies(campaign, said))


def _rides(campaign: Campaign, said: Row) -> tuple[str, ...]:
    """Return how external programs fare on the recorded drives, which they all get."""
    found = {row["first"]: row for row in said["backends"] if (row["arm"], row["measure"]) == (RIDES, "ate_m")}
    told = []
    for row in said["pooled"]:
        if row["backend"] in dict(campaign.external):
            lost, times = row["trials"] - row["sound"], found.get(row["backend"])
            words = [in_words(row)] if row["sound"] else []
            words += [f"path error {number(100.0 * row['ate_m']['mean'])} cm"] if row["ate_m"] else []
            words += [f"{estimated(times)} times that of {BASELINE_BACKEND}"] if times and times["value"] else []
            words += [f"{lost} of {row['trials']} drives lost ({row.get('lost')})"] if lost else []
            told.append(f"{row['backend']}: {', '.join(words)}")
    return (f"On the recorded drives, {'; '.join(told)}.",) if told else ()


def deciding_arm(campaign: Campaign) -> str:
    """Return the arm that the lines are about: the closed loop if there is one."""
    return CLOSED if CLOSED in campaign.arms else campaign.arms[0]


def _consistent(rows: Sequence[Row]) -> str:
    by = {verdict: [row for row in rows if row["verdict"] == verdict] for verdict in (CONSISTENT, CAUTIOUS, TOO_FEW)}
    parts = [f"{_names(by[verdict])} {verdict}" for verdict in (CONSISTENT, CAUTIOUS) if by[verdict]]
    over = sorted((row for row in rows if row["verdict"] == OVERCONFIDENT), key=lambda row: float(row["factor"]))
    parts += [f"{row['backend']} is overconfident by a factor of {number(row['factor'])}" for row in over]
    if few := by[TOO_FEW]:
        runs = max((row["map_anees"] or {"runs": 0})["runs"] for row in few)
        why = f"{runs} of the {FEW_RUNS} needed" if runs < FEW_RUNS else f"{runs} leave too wide an interval"
        parts.append(f"too few runs to tell for {listed([row['backend'] for row in few])} ({why})")
    words = "; ".join(parts)
    return f"{words[0].upper() if not by[CONSISTENT] and not over else words[0]}{words[1:]}."


def _names(rows: Sequence[Row]) -> str:
    return f"{listed([row['backend'] for row in rows])} {'is' if len(rows) == 1 else 'are'}"


def _costs(campaign: Campaign, said: Row, rows: Sequence[Row]) -> tuple[str, ...]:
    """Return the cost of the most overconfident estimator, or else that of the one with the largest wall error."""
    factors = {row["backend"]: row["factor"] or 0.0 for row in rows if row["verdict"] == OVERCONFIDENT}
    found = {(row["first"], row["measure"]): row for row in said["backends"] if row["arm"] == deciding_arm(campaign)}
    walls = {name: row["value"] for (name, what), row in found.items() if what == "wall_rmse_m" and row["value"]}
    if not walls:
        return ()
    worst = max(walls, key=lambda name: (factors.get(name, 0.0), walls[name]))
    return (
        f"{worst} compared with {BASELINE_BACKEND}: wall error {estimated(found[worst, 'wall_rmse_m'])} times, path"
        f" error {estimated(found[worst, 'ate_m'])} times, false matches {_signed(found[worst, 'false_matches'])} per"
        " run.",
    )


def _signed(difference: Row) -> str:
    return ("+" if (difference["value"] or 0.0) >= 0.0 else "") + estimated(difference)


def _strategies(campaign: Campaign, said: Row) -> tuple[str, ...]:
    backend = BASELINE_BACKEND if BASELINE_BACKEND in campaign.backends else campaign.backends[0]
    told = [
        f"{row['first']} drives {estimated(row)} times"
        for row in said["strategies"]
        if (row["measure"], row["backend"], row["arm"]) == ("path_length_m", backend, CLOSED) and row["value"]
    ]
    return (f"With {backend}, {listed(told)} as far as {BASELINE_STRATEGY}.",) if told else ()
