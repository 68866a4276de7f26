"""What a campaign must show, as a table that a person reads."""

from collections.abc import Callable
from typing import Any

from chainslam.viz.reports.report import PageTable

from ...views.numbers import NONE, number, percent
from ..comparison.words import ARMS_SHORT, within
from ..plan import Campaign

Row = dict[str, Any]
HOLDS = {True: "yes", False: "no"}
UNDECIDED = "too few runs to say"


def finding_table(campaign: Campaign, said: dict[str, Any]) -> PageTable:
    """Return the claims of `comparison.json` with what was found in each arm."""
    header = ("claim", "back end", *(ARMS_SHORT[arm] for arm in campaign.arms))
    rows = []
    for finding in said["findings"]:
        cells = (_cell(finding["kind"], finding["arms"].get(arm)) for arm in campaign.arms)
        rows.append((finding["claim"], finding["backend"], *cells))
    note = "yes, no: whether it holds in this campaign, as the numbers beside it stand; nothing where none is aimed at."
    return PageTable("Claims", header, tuple(rows), note, is_wordy=True)


def _cell(kind: str, told: Row | None) -> str:
    if told is None:
        return NONE
    words = SAYS[kind](told["found"])
    verdict = HOLDS.get(told["holds"]) or (UNDECIDED if kind == "anees" and words != NONE else "")
    return f"{verdict}: {words}" if verdict else words


def _wrong(found: Row) -> str:
    if found["wrong"] is None:
        return f"{number(found['sightings'])} observations, nothing to hold them against"
    share = f"{number(found['wrong'])} of {number(found['sightings'])} observations"
    return f"{share}, {percent(found['share'])} %; next {found['next']}, {percent(found['next_share'])} %"


def _trace(found: Row) -> str:
    return f"least trace {number(found['least'])} of the start's; below it in {percent(found['steps'])} % of the steps"


def _below(found: Row) -> str:
    runs = f"{number(found['bound_runs_below'])} of {number(found['sound'])} runs"
    if not found["bound_runs_below"]:
        return runs
    first, worst = (number(found[f"bound_{name}_m_median"]) for name in ("first", "worst"))
    by, most = (number(-found[name], 2) for name in ("bound_margin_median", "bound_margin"))
    return (
        f"{runs}: first after {first} m, at worst by {by} of the start's trace, after {worst} m (medians); by {most} in"
        " the worst run"
    )


def _anees(found: Row) -> str:
    left_out = f"; {number(found['without'])} complete runs have none" if found["without"] else ""
    return (within(number(found["mean"]), found) if "mean" in found else NONE) + left_out


def _held(found: Row) -> str:
    if "mean" not in found:
        return NONE
    counted = f"{number(found['distances'])} distances in {number(found['replays'])} runs"
    return within(f"{percent(found['mean'])} %", found, 100.0, counted)


def _doubles(found: Row) -> str:
    words = f"{number(found['double_entries'])} among {number(found['sightings'])} observations"
    beyond = found["beyond_a_run"]
    if beyond is None:
        return words
    more, side = beyond["mean"] > 0.0, 1.0 if beyond["mean"] > 0.0 else -1.0
    than = f"{'more' if more else 'fewer'} than that"
    if beyond["low"] is not None:
        ends = sorted(side * beyond[end] for end in ("low", "high"))
        than += f" ({number(ends[0])} to {number(ends[1])})"
    return f"{words}: {number(side * beyond['mean'])} a run {than}"


SAYS: dict[str, Callable[[Row], str]] = {
    "outside": lambda found: f"{percent(found['share'])} % of the steps",
    "wrong": _wrong,
    "trace": _trace,
    "margin": lambda found: f"margin {number(found['margin'], 2)}",
    "below": _below,
    "anees": _anees,
    "held": _held,
    "doubles": _doubles,
}
"""How the numbers of each kind of claim are told."""
