"""Tables of what the shortcut costs: every back end on the same observations, with true matches."""

from collections.abc import Mapping, Sequence

import numpy as np

from chainslam.experiments.replays.ideal import NAME as IDEAL
from chainslam.experiments.scoring.statistics import mean_interval
from chainslam.slam.backends import BACKENDS

from ..runner.rows import Row
from .figures import Found, Table, grouped, mean_of, numbers

WHOLE, PAPER, HONEST = "full-ekf", "block-ekf", "intersection-ekf"
"""Every correlation kept; the paper's blocks; the same blocks, each a bound."""
PLACES = {"paper-fig8": "figure 8", "paper-fig9": "figure 9"}
APARTMENTS = "apartments, with the lines that the extraction finds"
"""All other places are plans, a drive in each."""
SOUND = 1.5
"""A mean ANEES up to this is taken for consistent; a bound's may be as low as it likes."""


def rides(rows: Sequence[Row]) -> Found:
    """Return how honest and how precise each back end is on the same rides, place by place."""
    places: dict[str, list[Row]] = {}
    for row in rows:
        place = row["place"]
        places.setdefault(PLACES.get(place, place if place.startswith("ring") else APARTMENTS), []).append(row)
    return Found([], "", {_titled(name, own): rides_in(own) for name, own in places.items()})


def _titled(name: str, rows: Sequence[Row]) -> str:
    return f"{name[0].upper()}{name[1:]}, {len({(row['place'], row['seed']) for row in rows})} drives"


def rides_in(rows: Sequence[Row]) -> Found:
    """Return the same of the rides in one place."""
    by = {name: mine for name, mine in grouped(rows, "backend").items() if name in BACKENDS or name == IDEAL}
    head = ["back end", "pose ANEES from the start", "map ANEES", "NIS, scans in its band", "pose intervals that hold"]
    table: Table = [[*head, "position off, mm: rms, stated"]]
    for name, mine in by.items():
        noise = f"{mean_of(mine, 'nis'):.2f}, {100 * mean_of(mine, 'nis_in_band'):.0f} %"
        cells = [f"`{name}`", *(with_interval(mine, key) for key in ("pose_anees_from_start", "map_anees")), noise]
        off, stated = (1e3 * mean_of(mine, key) for key in ("pose_rms_m", "pose_sigma_m"))
        table.append([*cells, f"{100 * mean_of(mine, 'held'):.1f} %", f"{off:.3g}, {stated:.3g}"])
    return Found(table, verdict(by))


def with_interval(rows: Sequence[Row], name: str) -> str:
    """Return the mean, the 95 % interval of the mean over drives, and the median, of those that have a score."""
    values = np.array(numbers(rows, name))
    if not len(values):
        return "-"
    ends = mean_interval(values)
    interval = "" if ends is None else f" ({ends[0]:.3g} to {ends[1]:.3g})"
    lacking = f"; {len(rows) - len(values)} without" if len(values) < len(rows) else ""
    return f"{values.mean():.3g}{interval}, {np.median(values):.3g}{lacking}"


def verdict(by: Mapping[str, Sequence[Row]]) -> str:
    """Return which back ends are consistent, and what the paper's memory costs with and without honesty."""
    honest = [name for name, mine in by.items() if worst(mine) <= SOUND]
    words = f"Consistent, with both means up to {SOUND:g}: {', '.join(f'`{name}`' for name in honest) or 'none'}."
    if {WHOLE, PAPER, HONEST} <= by.keys():
        off, stated = (ratio(by[HONEST], by[WHOLE], key) for key in ("pose_rms_m", "pose_sigma_m"))
        words += (
            f" Beside `{WHOLE}`, `{HONEST}` errs by {off:.3g} times as much and states {stated:.3g} times as much;"
            f" `{PAPER}` errs by {ratio(by[PAPER], by[WHOLE], 'pose_rms_m'):.3g} times as much and states"
            f" {ratio(by[PAPER], by[WHOLE], 'pose_sigma_m'):.3g} times as much."
        )
    return words


def worst(rows: Sequence[Row]) -> float:
    """Return the larger of both mean ANEES; infinite where a drive has none."""
    scores = [[row[name] for row in rows] for name in ("pose_anees_from_start", "map_anees")]
    return max(float("inf") if None in own else float(np.mean(own)) for own in scores)


def ratio(first: Sequence[Row], second: Sequence[Row], name: str) -> float:
    """Return the geometric mean, over the drives, of what the first has over what the second has."""
    other = {(row["place"], row["seed"]): row[name] for row in second}
    return float(np.exp(np.mean([np.log(row[name] / other[row["place"], row["seed"]]) for row in first])))
