"""Merging campaigns: more seeds, worlds or back ends in one folder with one comparison."""

from collections.abc import Iterable, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from ..artifacts.files import json_bytes, stamp, write
from ..artifacts.settings import plain
from ..scoring.summary import TIMED
from ..usage import UsageError
from .comparison.tables import write_tables
from .plan import ARMS, Campaign, Trial, trials
from .scores.score import TrialScores
from .store import MERGED, Store, opened_anew, read_campaigns, read_config

SHARED = ("driver", "p0", "max_steps", "settings")
"""The settings that campaigns must have in common."""


def merge(folders: Sequence[Path], out: Path) -> None:
    """Write the folder of all trials of some campaigns; raises UsageError where they do not belong together.

    A trial that several of them have must have come out the same in all, timings excepted. A merge that was killed
    goes on when it is begun again.
    """
    if len(folders) < 2:
        raise UsageError(f"expected two or more campaigns to merge, found {len(folders)}: name another")
    stores = [Store(folder, campaign) for folder in folders for campaign in read_campaigns(folder)]
    campaigns = [store.campaign for store in stores]
    for name in SHARED:
        values = {str(getattr(campaign, name)) for campaign in campaigns}
        if len(values) > 1:
            words = " and ".join(sorted(values)) if name != "settings" else "campaigns that differ in them"
            raise UsageError(f"expected campaigns of one {name}, found {words}: merge others")
    commands: dict[str, set[str | None]] = {name: set() for each in campaigns for name, _ in each.external}
    for name, said in commands.items():
        said |= {dict(each.external).get(name) for each in campaigns if name in each.backends}
        if len(said) > 1:
            raise UsageError(f"expected one estimator {name}, found {len(said)} of other commands: merge others")
    digests: dict[str, Any] = {}
    for folder in folders:
        for world, digest in read_config(folder).worlds_sha256.items():
            if digests.setdefault(world, digest) != digest:
                raise UsageError(f"expected one world {world}, found two that differ: rename one and run it again")
    levels, found = union(campaigns), dict[Trial, Store]()
    for store in stores:
        for trial in trials(store.campaign):
            _take(found, trial, store)
    config = {**stamp(), MERGED: [plain(vars(each)) for each in campaigns], "worlds_sha256": digests}
    config |= {"from": [read_config(folder).said for folder in folders]}
    with opened_anew(out, json_bytes(config)):
        merged = Store(out, levels)
        for trial, store in found.items():
            copy = merged.path(trial)
            copy.parent.mkdir(parents=True, exist_ok=True)
            write(copy, store.path(trial).read_bytes())
        write_tables(out, levels, in_order(found, levels), merged.record)


def union(campaigns: Sequence[Campaign]) -> Campaign:
    """Return a campaign with the union of the levels of several, each in order of first occurrence."""
    worlds, backends, strategies = (
        tuple(dict.fromkeys(level for campaign in campaigns for level in getattr(campaign, name)))
        for name in ("worlds", "backends", "strategies")
    )
    arms = tuple(arm for arm in ARMS if any(arm in campaign.arms for campaign in campaigns))
    external = dict.fromkeys(each for campaign in campaigns for each in campaign.external)
    levels = replace(campaigns[0], worlds=worlds, backends=backends, strategies=strategies, arms=arms)
    return replace(levels, external=tuple(external))


def in_order(found: Iterable[Trial], levels: Campaign) -> list[Trial]:
    """Return trials in the order of the tables."""
    return sorted(
        found,
        key=lambda t: (
            levels.worlds.index(t.world), levels.strategies.index(t.strategy), levels.backends.index(t.backend),
            levels.arms.index(t.arm), t.seed,
        ),
    )  # fmt: skip


def _take(found: dict[Trial, Store], trial: Trial, store: Store) -> None:
    if not store.has(trial):
        raise UsageError(f"expected a finished campaign, found {store.folder} without {trial.path}: run it again")
    # Read before anything is written: an invalid result must not leave a half-made folder.
    record = store.record(trial)
    if trial in found and not same(found[trial].record(trial), record):
        raise UsageError(f"expected one result of {trial.path}, found two that differ: merge campaigns of one version")
    found.setdefault(trial, store)


def same(first: TrialScores, second: TrialScores) -> bool:
    """Return whether two results are the same, timings excepted."""
    keys = [record.summary.keys() - TIMED for record in (first, second)]
    return keys[0] == keys[1] and first.arrays.keys() == second.arrays.keys() and agree(first, second)


def agree(first: TrialScores, second: TrialScores) -> bool:
    """Return whether two results are the same in all that both hold, but for timings: later versions may keep more."""
    keys, names = first.summary.keys() & second.summary.keys() - TIMED, first.arrays.keys() & second.arrays.keys()
    return all(first.summary[key] == second.summary[key] for key in keys) and all(
        np.array_equal(first.arrays[name], second.arrays[name], equal_nan=True) for name in names
    )
