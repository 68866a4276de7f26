"""The report of an audit without any truth."""

import shlex
from collections.abc import Sequence

import numpy as np

from chainslam.slam.evaluation.consistency import chi2_band
from chainslam.viz.figures.maps import saved
from chainslam.viz.figures.plots import NeesCurve, draw_nees
from chainslam.viz.reports.report import Page, PagePicture, PageTable, Section, table
from chainslam.viz.text import NONE

from ....views.numbers import estimated, number, percent
from ..draws import evenly
from ..page import MOST_POINTS, colour
from .inner import Inner

MOST_LISTED = 50
"""Misfits in the table of the report."""
HOW = (
    "Squared differences between data and their prediction, over their stated covariance, per degree of freedom:"
    " ideally 1, with the 95 % interval in brackets. Effective samples: how many independent ones tell as much."
)


def page_without(found: Sequence[Inner], lines: Sequence[str], command: Sequence[str]) -> Page:
    """Return the report; `lines` are the verdicts, and `command` the words that make it again."""
    from importlib.metadata import version

    names = ", ".join(each.name for each in found[:3]) + (", ..." if len(found) > 3 else "")
    return Page(
        f"Audit of {names}, without a truth", tuple(lines), shlex.join(command), (("chainslam", version("chainslam")),),
        sections=(
            Section("Data against their prediction", (HOW,), (_table(found),)),
            *(_section(each, rank) for rank, each in enumerate(found)),
        ),
    )  # fmt: skip


def _table(found: Sequence[Inner]) -> PageTable:
    return table("Data against their prediction", {
        "file": lambda each: each.name,
        "judged": lambda each: each.told.subject,
        "verdict": lambda each: each.verdict.words if each.verdict else NONE,
        "factor": lambda each: number(each.verdict and each.verdict.factor),
        "per degree of freedom": _mean,
        "count": lambda each: f"{len(each.dof):,} {each.told.what}",
        "effective samples": lambda each: number(each.draws, 2) if each.verdict else NONE,
        "inside 95 %": lambda each: f"{percent(each.covered)} %",
        "misfits": lambda each: number(len(each.misfits)),
    }, found)  # fmt: skip


def _mean(each: Inner) -> str:
    low, high = each.interval if each.verdict else (None, None)
    return estimated({"mean": each.mean, "low": low, "high": high})


def _section(each: Inner, rank: int) -> Section:
    rows = evenly(len(each.at), MOST_POINTS)
    bands = {dof: chi2_band(dof) for dof in np.unique(each.dof).tolist()}
    band = np.array([bands[dof] for dof in each.dof[rows].tolist()]).T / each.dof[rows]
    curve = NeesCurve(
        each.name, each.at[rows], np.maximum((each.squared / each.dof)[rows], 1e-6), band, None, colour(rank)
    )
    figure = draw_nees([curve], each.told.along, each.told.statistic)
    words = (
        f"{each.told.statistic} of the {each.told.what}, by {each.told.along}, with the band in which 95 % of them lie"
        " if the covariances are right"
    )
    told = (f"It tells {each.told.can}.", f"It cannot tell {each.told.cannot}.", *each.notes)
    return Section(each.name, told, (_misfits(each),), (PagePicture(saved(figure, "svg"), words),))


def _misfits(each: Inner) -> PageTable:
    return table("Beyond the level that none exceeds with 95 %, the largest first", {
        each.told.what: lambda row: each.names[row] if each.names else number(float(each.at[row])),
        "squared, per degree of freedom": lambda row: number(float(each.squared[row] / each.dof[row])),
    }, each.misfits[:MOST_LISTED].tolist())  # fmt: skip
