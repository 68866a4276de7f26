"""The report of a campaign: its tables and pictures, and the numbers that the template's captions need."""

from pathlib import Path

from chainslam.viz.reports.report import Page, PageTable, table

from ...scoring.statistics import FEW_RUNS, LEAST
from ...views.numbers import listed, number
from ..comparison.comparison import BASELINE_BACKEND, BASELINE_STRATEGY, Row
from ..comparison.consistency import WITHIN
from ..comparison.families import CLEAR, family_of
from ..comparison.tables import read_comparison
from ..merge import union
from ..plan import CLOSED, Campaign, command_of, is_errorless, world_key
from ..store import read_config
from . import tables as shown
from .lines import deciding_arm, lines_of
from .pictures import coverage_pictures, map_pictures, nees_pictures, strategy_shown

MOST_LISTED = 4
"""Names beyond which a title counts them."""
MOST_CURVES = 4
"""Pictures of curves beyond which they are folded."""


def campaign_page(folder: Path) -> Page:
    """Return the report of a campaign's folder; raises UsageError if it is not a finished campaign."""
    config = read_config(folder)
    campaigns = config.campaigns
    campaign = union(campaigns)
    said = read_comparison(folder)
    arm = deciding_arm(campaign)
    exact, rest = is_errorless(campaign), [each for each in campaign.arms if each != arm]
    curves, others = ((), ()) if exact else (nees_pictures(folder, campaigns, arms) for arms in ([arm], rest))
    maps = list(map_pictures(folder, campaigns, arm).items())
    return Page(
        f"{_named(campaign.backends, 'estimators')} in {_named([*map(world_key, campaign.worlds)], 'worlds')}",
        lines_of(campaign, said),
        "; ".join(command_of(each) for each in campaigns),
        (*config.versions.items(), ("commit", str(config.commit)[:10])),
        template="campaign",
        told=_told(campaign, said, [world for world, _ in maps], exact),
        tables=_tables(campaign, said, exact),
        pictures={
            "curves": curves[:MOST_CURVES], "other curves": (*curves[MOST_CURVES:], *others),
            "coverage": coverage_pictures(folder, campaigns) if len(campaign.strategies) > 1 else (),
            **{f"maps {k}": pictures for k, (_, pictures) in enumerate(maps)},
        },
    )  # fmt: skip


def _named(names: tuple[str, ...] | list[str], what: str) -> str:
    return listed(names) if len(names) <= MOST_LISTED else f"{len(names)} {what}"


def _told(campaign: Campaign, said: Row, worlds: list[str], exact: bool) -> Row:
    """Return the values for the captions of the template."""
    rows = [row for row in said["pooled"] if row["arm"] == deciding_arm(campaign)]
    sound = sum(row["sound"] for row in rows)
    return {
        "counts": said["counts"], "exact": exact, "arm": shown.ARMS[deciding_arm(campaign)], "worlds": worlds,
        "strategies": campaign.strategies, "shown": strategy_shown(campaign), "seed": campaign.first_seed,
        "runs": campaign.trials * len(campaign.worlds), "trials": campaign.trials, "least": LEAST, "few": FEW_RUNS,
        "aim": (number(1.0 / WITHIN), number(WITHIN)), "level": CLEAR, "sound": sound,
        "baselines": (BASELINE_BACKEND, BASELINE_STRATEGY), "hypothesis": said["hypothesis"],
        "families": {name: family_of(said[name]) for name in ("backends", "strategies", "interaction")},
        "without": {shown.MEASURES[key]: sum(row["without"].get(key, 0) for row in rows) for key in
                    ("pose_anees_from_start", "map_anees", "wall_rmse_m")},
    }  # fmt: skip


def _tables(campaign: Campaign, said: Row, exact: bool) -> dict[str, PageTable]:
    """Return the tables by name; in a campaign without noise, without those that need a NEES."""
    arm = deciding_arm(campaign)
    closed = [row for row in said["strategies"] if row["arm"] == CLOSED]
    both = [row for row in said["interaction"] if row["arm"] == CLOSED]
    cells = [cell for cell in said["cells"] if cell["arm"] == arm] if len(said["cells"]) > len(said["pooled"]) else []
    told = shown.without_anees if exact else lambda columns: columns
    found = {
        "estimators": _of_arm(arm, said, told(shown.ESTIMATORS)),
        "cells": table(f"Each world and strategy, {shown.ARMS[arm]}", told(shown.CELLS), cells),
        "strategies": shown.crossed("Strategies", closed, {"strategy": "first", "estimator": "backend"},
                                    shown.OF_STRATEGIES),
        "explored": table("How soon the floor is seen, closed loop", shown.EXPLORED, said.get("exploration", [])),
        "marks": shown.marks_table(said, told(shown.MARKS)),
    }  # fmt: skip
    if exact:
        return found
    backends = [row for row in said["backends"] if row["arm"] == arm]
    kept = (*shown.COSTS, "pose_anees_from_start", "map_anees")
    return found | {
        "costs": shown.crossed("Costs", backends, {"estimator": "first"}, shown.COSTS),
        "interaction": shown.crossed(
            "Interaction of strategy and estimator", both, {"strategy": "strategy", "estimator": "backend"},
            shown.OF_STRATEGIES,
        ),
        **{f"replays {a}": _of_arm(a, said, shown.ESTIMATORS) for a in campaign.arms if a != arm},
        **{f"stated {a}": _of_arm(a, said, shown.STATED) for a in campaign.arms},
        **{f"errors {a}": _of_arm(a, said, shown.ERRORS) for a in campaign.arms},
        "claims": shown.claims(campaign.arms, said),
        "hypothesis": shown.hypothesis_table(said["hypothesis"]),
        "differences": shown.differences(
            f"Estimators compared with {BASELINE_BACKEND}",
            [row for row in said["backends"] if row["measure"] in kept], {"estimator": "first", "arm": "arm"},
        ),
    }  # fmt: skip


def _of_arm(arm: str, said: Row, columns: shown.Columns) -> PageTable:
    return table(shown.ARMS[arm], columns, [row for row in said["pooled"] if row["arm"] == arm])
