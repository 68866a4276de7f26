"""Comparison of two campaigns, trial by trial: which trials differ, and by how much overall."""

from collections.abc import Mapping, Sequence
from itertools import product
from pathlib import Path
from typing import Any

from ..artifacts.files import csv_bytes, json_bytes, stamp, write
from ..artifacts.reading import read_json
from ..artifacts.settings import leaves, nested, record_of, trial_of
from ..usage import UsageError
from .comparison import shapes
from .comparison.comparison import MEASURES, Row, difference, select
from .comparison.families import in_family
from .comparison.tables import trial_row
from .merge import agree, in_order, union
from .plan import Trial, trials
from .store import Store, opened_anew, read_campaigns, read_config

CONTRAST, TRIALS = "contrast.json", "contrast.csv"
SETTINGS = ("driver", "p0", "max_steps")
NAMES = ("world", "strategy", "backend", "mode", "association", "seed")
COMPARED = ("status", "steps", "path_length_m", "coverage", *(measure.name for measure in MEASURES))
"""Columns that are written for both campaigns if a trial differs."""


def contrast(first: Path, second: Path, out: Path) -> None:
    """Write how the second campaign differs from the first; raises UsageError where they share no trial.

    `contrast.csv` has a row for each trial that came out differently, `contrast.json` the paired differences, second
    less first or second over first, for each back end in each arm.
    """
    ours, theirs = _stores(first), _stores(second)
    _same_worlds(first, second)
    levels = union([store.campaign for store in (*ours.values(), *theirs.values())])
    both = in_order(ours.keys() & theirs.keys(), levels)
    if not both:
        raise UsageError(f"expected campaigns that share trials, found {first} and {second} with none: name others")
    rows: tuple[list[Row], list[Row]] = ([], [])
    different = []
    for trial in both:
        records = ours[trial].record(trial), theirs[trial].record(trial)
        before, after = map(trial_row, records)
        rows[0].append(before)
        rows[1].append(after)
        if not agree(*records):
            different.append(_side_by_side(before, after))
    said = {
        **stamp(),
        "first": str(first),
        "second": str(second),
        "settings": _settings(first, second),
        "trials": {
            "shared": len(both),
            "the_same": len(both) - len(different),
            "different": len(different),
            "only_first": len(ours) - len(both),
            "only_second": len(theirs) - len(both),
        },
        "status": _statuses(*rows),
        "differences": _differences(*rows),
        "different_trials": different,
    }
    with opened_anew(out):
        header = list(different[0]) if different else [*NAMES]
        write(out / TRIALS, csv_bytes(header, [[row[name] for name in header] for row in different]))
        write(out / CONTRAST, json_bytes(said))


def read_contrast(folder: Path) -> dict[str, Any]:
    """Return the result of `contrast` in a folder; raises UsageError."""
    return read_json(folder / CONTRAST, shapes.CONTRAST, "run `compare --against` again")


def _stores(folder: Path) -> dict[Trial, Store]:
    """Return the row of each trial of a campaign; trials without a result are omitted."""
    stores = [Store(folder, campaign) for campaign in read_campaigns(folder)]
    return {trial: store for store in stores for trial in trials(store.campaign) if store.has(trial)}


def _same_worlds(first: Path, second: Path) -> None:
    digests = [read_config(folder).worlds_sha256 for folder in (first, second)]
    for world in sorted(digests[0].keys() & digests[1].keys()):
        if digests[0][world] != digests[1][world]:
            raise UsageError(f"expected one world {world}, found two that differ: rename one and run it again")


def _settings(first: Path, second: Path) -> dict[str, list[Any]]:
    """Return the settings, versions and commits in which the two campaigns differ."""
    pair = [_made_with(folder) for folder in (first, second)]
    names = sorted(pair[0].keys() | pair[1].keys())
    return {name: [made.get(name) for made in pair] for name in names if pair[0].get(name) != pair[1].get(name)}


def _made_with(folder: Path) -> dict[str, Any]:
    config = read_config(folder)
    campaign = config.campaigns[0]
    settings = dict(leaves(record_of(trial_of(nested(campaign.settings)))))
    ruled: dict[str, Any] = {name: getattr(campaign, name) for name in SETTINGS}
    return settings | ruled | {"commit": config.commit} | config.versions


def _side_by_side(first: Row, second: Row) -> Row:
    sides = {"first": first, "second": second}
    values = {f"{name}_{side}": row.get(name) for name in COMPARED for side, row in sides.items()}
    return {name: first[name] for name in NAMES} | values


def _statuses(first: Sequence[Row], second: Sequence[Row]) -> Mapping[str, int]:
    """Count how often a trial changed from one status to another."""
    changes = [f"{a['status']} -> {b['status']}" for a, b in zip(first, second, strict=True)]
    return {change: changes.count(change) for change in dict.fromkeys(changes)}


def _differences(first: Sequence[Row], second: Sequence[Row]) -> list[Row]:
    """Compare every measure, for each back end in each arm."""
    cells = dict.fromkeys((row["backend"], row["mode"], row["association"]) for row in first)
    found = []
    for (backend, mode, association), measure in product(cells, MEASURES):
        names = {"backend": backend, "mode": mode, "association": association}
        pair = (select(second, **names), select(first, **names))
        found.append(names | difference(*pair, measure))
    return in_family(found)
