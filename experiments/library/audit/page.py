"""The report of an audit: its tables and pictures."""

import shlex
from collections.abc import Sequence
from math import degrees
from typing import Any

import numpy as np

from chainslam.slam.evaluation.consistency import chi2_band
from chainslam.viz import palette
from chainslam.viz.figures.maps import saved
from chainslam.viz.figures.plots import NeesCurve, draw_nees
from chainslam.viz.figures.stated_errors import draw_stated_errors
from chainslam.viz.reports.report import Page, PagePicture, PageTable, Section, table
from chainslam.viz.text import NONE

from ...views.numbers import estimated, number, percent
from .audited import Audited
from .draws import LEVELS, evenly
from .geometry.kinds import parts
from .verdicts import Pair, Pooled

AXES = {
    "additive": ("x (m)", "y (m)", "heading (degrees)"),
    "body": ("forward (m)", "left (m)", "heading (degrees)"),
    "world": ("x, world frame (m)", "y, world frame (m)", "heading (degrees)"),
}
AXES_IN_SPACE = {
    frame: tuple(f"{axis} ({unit})" for unit, axes in (("m", shifts), ("degrees", turns)) for axis in axes)
    for frame, shifts, turns in (
        ("additive", "xyz", ("roll", "pitch", "yaw")), ("body", ("forward", "left", "up"), ("roll", "pitch", "yaw")),
        ("world", "xyz", ("about x", "about y", "about z")),
    )
}  # fmt: skip
MOST_POINTS = 2000
"""Points of a curve; more are not seen."""
TURNS = (3, 0, 5, 2, 6, 1, 4, 7)
"""Places in the palette, in which neighbours differ most."""
MOST_CURVES = len(TURNS)


def page_of(
    found: Sequence[Audited], pooled: Pooled | None, pairs: Sequence[Pair], lines: Sequence[str], command: Sequence[str]
) -> Page:
    """Return the report of trajectories; `lines` are the verdicts, and `command` the words that make it again."""
    from importlib.metadata import version

    names = ", ".join(each.name for each in found[:3]) + (", ..." if len(found) > 3 else "")
    return Page(
        f"Audit of {names}", tuple(lines), shlex.join(command), (("chainslam", version("chainslam")),),
        sections=(
            Section("Errors and covariances", (_how(found),), (_table(found, pooled), _pairs(pairs)), _curves(found)),
            *(_section(each, rank) for rank, each in enumerate(found)),
        ),
    )  # fmt: skip


def _how(found: Sequence[Audited]) -> str:
    frames = " and ".join(dict.fromkeys(each.error_in_words for each in found))
    return (
        f"NEES: squared error over stated covariance; {frames}. ANEES: its mean over the number of its axes, ideally 1,"
        " with the 95 % interval in brackets. Effective samples: errors that last from pose to pose count once, and the"
        " interval is that of so many independent ones."
    )


def _mean(of: dict[str, Any]) -> str:
    low, high = of["anees_interval"]
    return estimated({"mean": of["anees"], "low": low, "high": high})


def _table(found: Sequence[Audited], pooled: Pooled | None) -> PageTable:
    rows, turn = [each.record() for each in found], found[0].turn
    if pooled is not None:
        rows.append({"file": f"{pooled.runs} runs together", **pooled.record()})
    return table(
        "Errors and covariances",
        {
            "trajectory": lambda row: row["file"],
            "verdict": lambda row: row["verdict"],
            "factor": lambda row: number(row["factor"]),
            "ANEES": _mean,
            "position": lambda row: _mean(row["position"]) if "position" in row else NONE,
            turn: lambda row: _mean(row[turn]) if turn in row else NONE,
            "from the start": lambda row: number(row.get("anees_from_start")),
            "effective samples": lambda row: number(row.get("effective_samples"), 2),
            "error, m": lambda row: _beside(row, "position_m", 1.0),
            "error, degrees": lambda row: _beside(row, f"{turn}_rad", degrees(1.0)),
        },
        rows,
        "Factor: error over stated sigma of an overconfident estimate, stated sigma over error of a cautious one.",
    )


def _beside(row: dict[str, Any], of: str, scale: float) -> str:
    """Return an error with the stated one in brackets."""
    if f"rms_{of}" not in row:
        return NONE
    return f"{number(scale * row[f'rms_{of}'])} (stated {number(scale * row[f'stated_{of}'])})"


def _degrees(angle: float | None) -> str:
    return number(None if angle is None else degrees(angle))


def _pairs(pairs: Sequence[Pair]) -> PageTable:
    return table("Compared at the same times", {
        "trajectory": lambda pair: pair.first,
        "compared with": lambda pair: pair.second,
        "times the NEES": lambda pair: estimated({
            "mean": pair.ratio, "low": pair.interval and pair.interval[0], "high": pair.interval and pair.interval[1],
        }),
        "stretches": lambda pair: number(pair.blocks),
    }, pairs)  # fmt: skip


def _curves(found: Sequence[Audited]) -> tuple[PagePicture, ...]:
    shown = found[:MOST_CURVES]
    curves = []
    for rank, each in enumerate(shown):
        rows = evenly(len(each.time_s), MOST_POINTS)
        band = np.tile(np.array(chi2_band(each.errors.shape[1]))[:, None], len(rows))
        nees = np.maximum(each.nees[rows], 1e-6)
        curves.append(NeesCurve(each.name, each.time_s[rows] - found[0].time_s[0], nees, band, None, colour(rank)))
    words = "NEES of the pose, with the band in which it lies in 95 % of the poses of a consistent estimate"
    return (PagePicture(saved(draw_nees(curves, "time (s)"), "svg"), words),)


def _section(each: Audited, rank: int) -> Section:
    rows = evenly(len(each.time_s), MOST_POINTS)
    sigmas = np.sqrt(np.einsum("nii->ni", each.covs[rows]))
    scale = np.repeat([1.0, degrees(1.0)], [len(sigmas[0, part]) for part in parts(sigmas.shape[1])])
    names = AXES[each.frame] if each.turn == "heading" else AXES_IN_SPACE[each.frame]
    figure = draw_stated_errors(
        each.time_s[rows] - each.time_s[0], scale * each.errors[rows], scale * sigmas, names, colour(rank)
    )
    words = "Errors, and the intervals in which 95 % of them lie if the covariances are right"
    pictures = (PagePicture(saved(figure, "svg"), words),)
    return Section(each.name, (*each.notes, *each.hints), (_coverage(each), _lags(each)), pictures)


def _coverage(each: Audited) -> PageTable:
    of = {"pose": each.pose, "position": each.position, each.turn: each.heading}
    columns = {"quantity": lambda name: name} | {
        f"{100.0 * level:g} % region": (lambda name, k=k: f"{percent(of[name].covered[k])} %")
        for k, level in enumerate(LEVELS)
    }
    return table("Share of the errors inside their stated regions", columns, tuple(of))


def _lags(each: Audited) -> PageTable:
    note = "At least: of two poses only the single covariances are stated, not their correlation, and the largest" \
           " possible covariance of the relative pose is taken."  # fmt: skip
    return table("Relative poses", {
        "steps": lambda lag: number(lag.steps),
        "ANEES": lambda lag: ("at least " if lag.is_bound else "") + number(lag.score.anees),
        "error, m": lambda lag: number(lag.error_m),
        "error, degrees": lambda lag: _degrees(lag.error_rad),
    }, each.lags, note if any(lag.is_bound for lag in each.lags) else "")  # fmt: skip


def colour(rank: int) -> str:
    """Return the colour of the curve of a rank."""
    return palette.of_rank(TURNS[rank % len(TURNS)])
