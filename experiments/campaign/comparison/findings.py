"""The claims of a campaign: what was found in each arm, and whether each claim holds there."""

from collections.abc import Callable, Sequence
from typing import Any

from ...scoring.statistics import FEW_RUNS

Row = dict[str, Any]
Judge = Callable[[Row], tuple[Row, bool | None]]
PAPER, BASELINE = "block-ekf", "full-ekf"
CONSISTENT = ("fej-ekf", "invariant-ekf", "graph")
"""Back ends whose Jacobians preserve the unobservable directions."""
MATCHING = ("wrong", "doubles")
"""Claims that do not apply if the association is the true one."""
MOST = 0.5
ANEES_AIM = (0.9, 1.1)
HELD_AIM = (0.93, 0.97)
BOUND_ROUNDING = 1e-6


def findings(pooled: Sequence[Row], gate: float) -> list[Row]:
    """Return a row for each claim and back end; `arms` gives for each arm what was `found`, and whether it `holds`.

    `pooled` has a row for each back end in each arm. Claims on matching leave out the arm whose matches are the
    truth's; `holds` is None where nothing is aimed at, or where too few runs decide it.
    """
    of = {(row["backend"], row["arm"]): row for row in pooled}
    arms = list(dict.fromkeys(row["arm"] for row in pooled))
    names = list(dict.fromkeys(row["backend"] for row in pooled))
    anees, held = "{:g} to {:g}".format(*ANEES_AIM), "{:g} to {:g} %".format(*(100 * share for share in HELD_AIM))
    refused = f"{100 * (1 - gate):g} %"
    claims: list[tuple[str, str, str, Judge]] = [
        ("outside", PAPER, "outside its 95 % band for most of the run", _outside),
        ("wrong", PAPER, "more false matches and duplicate walls than any other", lambda row: _wrong(row, pooled)),
        ("trace", PAPER, "comes to claim more than at its start", _trace),
        *(("margin", name, "never below the bound", _never_below) for name in CONSISTENT),
        ("below", BASELINE, "below the bound: from where on, by how much", _below),
        ("anees", "graph", f"interval of the mean pose ANEES from the start within {anees}", _anees),
        ("held", "graph", f"95 % intervals of distances hold the truth in {held}", _held),
        ("held", PAPER, "95 % intervals of distances hold the truth: how rarely", lambda row: (_held(row)[0], None)),
        *(("doubles", name, f"no more duplicate walls than the {refused} that its gate must refuse", _doubles)
          for name in names if any(row["sightings"] is not None for row in pooled if row["backend"] == name)),
    ]  # fmt: skip
    found = []
    for kind, backend, words, judge in claims:
        told = {}
        for arm in arms if backend in names else ():
            row = of.get((backend, arm))
            if row and row["sound"] and not (kind in MATCHING and arm == "replay-true"):
                numbers, holds = judge(row)
                told[arm] = {"found": numbers, "holds": holds}
        if told:
            found.append({"kind": kind, "claim": words, "backend": backend, "arms": told})
    return found


def _outside(row: Row) -> tuple[Row, bool | None]:
    share = row["steps_outside_band"]
    return {"share": share}, None if share is None else share > MOST


def _wrong(row: Row, pooled: Sequence[Row]) -> tuple[Row, bool | None]:
    """Per observation, since one back end may drive farther than another."""
    rates = {r["backend"]: _rate(r) for r in pooled if r["arm"] == row["arm"] and r["sightings"]}
    others = {name: rate for name, rate in rates.items() if name != row["backend"]}
    if row["backend"] not in rates or not others:
        return {"wrong": None, "sightings": row["sightings"]}, None
    worst = max(others, key=lambda name: others[name])
    numbers = {
        "wrong": row["matches_false"] + row["double_entries"],
        "sightings": row["sightings"],
        "share": rates[row["backend"]],
        "next": worst,
        "next_share": others[worst],
    }
    return numbers, rates[row["backend"]] > others[worst]


def _rate(row: Row) -> float:
    return float((row["matches_false"] + row["double_entries"]) / row["sightings"])


def _trace(row: Row) -> tuple[Row, bool | None]:
    least, below = row["trace_least"], row["trace_below"]
    return {"least": least, "steps": below and below["mean"]}, None if least is None else least < 1.0


def _never_below(row: Row) -> tuple[Row, bool | None]:
    margin = row["bound_margin"]
    return {"margin": margin}, None if margin is None else margin >= -BOUND_ROUNDING


def _below(row: Row) -> tuple[Row, bool | None]:
    names = ("bound_margin", "bound_runs_below", "bound_margin_median", "bound_first_m_median", "bound_worst_m_median")
    return {name: row[name] for name in (*names, "sound")}, None


def _anees(row: Row) -> tuple[Row, bool | None]:
    pose = row["pose_anees_from_start"]
    return dict(pose or {}) | {"without": row["without"]["pose_anees_from_start"]}, _inside(pose, ANEES_AIM)


def _held(row: Row) -> tuple[Row, bool | None]:
    held = row["distances_in_95"]
    return dict(held or {}) | {"distances": row["distances"], "replays": row["sound"]}, _mean_in(held, HELD_AIM)


def _doubles(row: Row) -> tuple[Row, bool | None]:
    beyond = row["doubles_beyond_gate"]
    numbers = {"double_entries": row["double_entries"], "sightings": row["sightings"], "beyond_a_run": beyond}
    return numbers, None if beyond is None else beyond["mean"] <= 0.0


def _inside(estimate: Row | None, aim: tuple[float, float]) -> bool | None:
    """Return whether an interval lies within the aim; None if only partly, or for few runs, where more would decide."""
    if estimate is None or estimate["runs"] < FEW_RUNS or estimate["low"] is None:
        return None
    if aim[0] <= estimate["low"] and estimate["high"] <= aim[1]:
        return True
    apart = estimate["high"] < aim[0] or aim[1] < estimate["low"]
    return False if apart else None


def _mean_in(estimate: Row | None, aim: tuple[float, float]) -> bool | None:
    return None if estimate is None else aim[0] <= estimate["mean"] <= aim[1]
