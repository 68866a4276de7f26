"""An audit in words."""

from math import degrees
from typing import Any

from ...views.numbers import number, percent
from .audited import DEFAULT, Audited
from .draws import LEVELS
from .verdicts import TOO_FEW, Pooled


def lines(found: Audited, is_told: bool) -> list[str]:
    """Return the audit of a trajectory in four to six lines; `is_told` says whether the frame was asked for."""
    record, pose = found.record(), found.pose
    least = "at least " if found.is_bound else ""
    start = "" if found.from_start is None else f", relative to the start {number(found.from_start)}"
    frame = found.error_in_words + ("" if is_told or found.frame != DEFAULT else ", by default")
    inside = percent(pose.covered[LEVELS.index(0.95)])
    told = [
        f"{found.name}: {found.verdict.told()}",
        f"  ANEES {least}{number(pose.anees)} (95 % interval {number(pose.low)} to {number(pose.high)}; ideally 1):"
        f" position {number(found.position.anees)}, {found.turn} {number(found.heading.anees)}{start}",
        f"  {pose.count:,} {found.what}, effective sample size {number(pose.draws, 2)}; {inside} % of them inside"
        f" their 95 % region; {frame}",
        f"  rms error {_sizes(record, f'rms_position_m rms_{found.turn}_rad')}, stated"
        f" {_sizes(record, f'stated_position_m stated_{found.turn}_rad')}",
    ]
    if found.notes:
        told.append(f"  note: {'; '.join(found.notes)}")
    if found.hints:
        told.append(f"  hint: {'; '.join(found.hints)}")
    return told


def _sizes(record: dict[str, Any], keys: str) -> str:
    metres, turn = (record[key] for key in keys.split())
    return f"{number(metres)} m and {number(degrees(turn))} degrees"


def pooled_line(found: Pooled) -> str:
    """Return the verdict over several runs of one estimator."""
    many = f"mean {found.statistic} {number(found.mean)}, 95 % interval {number(found.low)} to {number(found.high)}"
    many = f" ({many})" if found.verdict.words == TOO_FEW else f"; {many}"
    return f"{found.runs} runs together: {found.verdict.told()}{many}"
