"""What others measured of a drive, by other clocks and in other units."""

from pathlib import Path

import numpy as np

from chainslam.experiments.replays.measured import check_references
from chainslam.experiments.replays.sources import RealLog
from chainslam.experiments.scoring.without_truth.references import read_references

from .case import Case, Rng, pick
from .logs import SCANS, drive, read

CLOCKS = {"nanoseconds": 1e9, "microseconds": 1e6, "milliseconds": 1e3}
LENGTHS = {"millimetres": 1000.0, "centimetres": 100.0, "inches": 39.37}


def reference(rng: Rng, folder: Path) -> Case:
    """A path or relations: of the same clock, also to some milliseconds, of another one, or in another unit."""
    made = drive(rng)
    times, poses, refused = made.time_s + rng.uniform(-0.004, 0.004, SCANS), made.poses, ""
    match int(rng.integers(5)):
        case 0:
            unit = pick(rng, sorted(CLOCKS))
            times, refused = np.round(CLOCKS[unit] * times), f"its times are in {unit}"
        case 1:
            times, refused = times - times[0], "its times count from its beginning"
        case 2:
            times, refused = times + pick(rng, (-1.0, 1.0)) * rng.uniform(100.0, 1e6), "use one of this drive"
        case 3:
            unit = pick(rng, sorted(LENGTHS))
            poses, refused = poses * [LENGTHS[unit], LENGTHS[unit], 1.0], f"{unit}? divide it"
        case _:
            pass
    path = folder / "measured.txt"
    if is_path := bool(rng.random() < 0.5):
        rows = [[t, *p] for t, p in zip(times, poses, strict=True)]
    else:
        rows = [
            [times[a], times[b], *(poses[b] - poses[a])[:2], 0.0, 0.0, 0.0, 0.0]
            for a, b in (sorted(rng.choice(SCANS, 2, replace=False)) for _ in range(20))
        ]
    path.write_text("".join(" ".join(f"{value:.6f}" for value in row) + "\n" for row in rows))
    load = read(folder, made.flaser())

    def check() -> None:
        given = read_references(None, path) if is_path else read_references(path, None)
        check_references(given, *RealLog(load()).odometry)

    return Case(check, refused=refused)
