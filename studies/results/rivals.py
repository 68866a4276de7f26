"""The tables of every back end on the same observations, with true matches."""

from collections.abc import Mapping, Sequence

import numpy as np

from chainslam.experiments.replays.ideal import NAME as IDEAL
from chainslam.experiments.scoring.statistics import mean_interval
from chainslam.slam.backends import BACKENDS

from ..runner.marks import short
from ..runner.rows import Row
from .figures import Table, grouped, mean_of, numbers

WHOLE = "full-ekf"
"""The baseline: it keeps every correlation."""
PLACES = {"paper-fig8": "figure 8", "paper-fig9": "figure 9"}
APARTMENTS = "apartments"
"""All other places are plans, a drive in each."""


def by_place(rows: Sequence[Row]) -> Mapping[str, Sequence[Row]]:
    """Return the rows by their place in words, with the number of drives there."""
    places: dict[str, list[Row]] = {}
    for row in rows:
        place = row["place"]
        places.setdefault(PLACES.get(place, place if place.startswith("ring") else APARTMENTS), []).append(row)
    return {f"{name}, {len({(row['place'], row['seed']) for row in own})} drives": own for name, own in places.items()}


def by_backend(rows: Sequence[Row]) -> Mapping[str, Sequence[Row]]:
    """Return the rows of each back end that there is."""
    return {name: own for name, own in grouped(rows, "backend").items() if name in BACKENDS or name == IDEAL}


def rides(rows: Sequence[Row]) -> Mapping[str, Table]:
    """Return a table for each place: how consistent and how precise each back end is on the same drives."""
    return {f"### {name[0].upper()}{name[1:]}": _rides_in(own) for name, own in by_place(rows).items()}


def _rides_in(rows: Sequence[Row]) -> Table:
    head = ["back end", "pose ANEES from the start", "map ANEES", "NIS, scans in its band", "pose intervals that hold"]
    table: Table = [[*head, "position error, mm: rms, stated", f"both over those of `{WHOLE}`"]]
    by = by_backend(rows)
    for name, mine in by.items():
        noise = f"{mean_of(mine, 'nis'):.2f}, {100 * mean_of(mine, 'nis_in_band'):.0f} %"
        cells = [f"`{name}`", *(_with_interval(mine, key) for key in ("pose_anees_from_start", "map_anees")), noise]
        off, stated = (1e3 * mean_of(mine, key) for key in ("pose_rms_m", "pose_sigma_m"))
        cells += [f"{100 * mean_of(mine, 'held'):.1f} %", f"{short(off)}, {short(stated)}"]
        table.append([*cells, ratios(mine, by.get(WHOLE, ()))])
    return table


def _with_interval(rows: Sequence[Row], name: str) -> str:
    """Return the mean, the 95 % interval of the mean over drives, and the median, of those that have a score."""
    values = np.array(numbers(rows, name))
    if not len(values):
        return "-"
    ends = mean_interval(values)
    interval = "" if ends is None else f" ({short(ends[0])} to {short(ends[1])})"
    lacking = f"; {len(rows) - len(values)} without" if len(values) < len(rows) else ""
    return f"{short(values.mean())}{interval}, {short(float(np.median(values)))}{lacking}"


def ratios(rows: Sequence[Row], whole: Sequence[Row]) -> str:
    """Return error and stated sigma over those of the baseline on the same drives, geometric means."""
    beside = {(row["place"], row["seed"]): row for row in whole}
    pairs = [(row, beside[key]) for row in rows if (key := (row["place"], row["seed"])) in beside]
    if not pairs:
        return "-"
    logs = np.log([[own[name] / other[name] for name in ("pose_rms_m", "pose_sigma_m")] for own, other in pairs])
    return ", ".join(f"{factor:.2f}" for factor in np.exp(logs.mean(axis=0)))
