"""Do maps hold where walls have steps, bends and pilasters of 10 to 60 mm? Apartments whose walls are made so.

.venv/bin/python -m studies.plans.uneven --plans ../shared/data/plans
"""

import json
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import shapely

from chainslam.experiments.scenario import TrialConfig, load_world
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError
from chainslam.sim.worlds import World

from ..runner.command import run_study
from ..runner.tables import headed
from ..runner.trials import rows_of
from .uneven_walls import uneven

EVERY = 13
"""Every so manyth apartment: 12 of 160 (and one)."""

HEAD = ("world", "status", "steps", "map_anees", "pose_anees", "false_matches", "duplicate_lines", "open_ends")


@dataclass(frozen=True)
class UnevenStudy:
    """Explore uneven apartments and print how consistent their maps are."""

    plans: Path
    """A folder of plans, `lifull_*`."""
    count: int = 12
    """How many apartments."""
    seeds: int = 1
    """Runs in each."""
    backend: str = "invariant-ekf"
    """The estimator."""
    max_steps: int = 5000
    """A run is stopped after this many scans."""
    jobs: int = 2
    """Number of processes."""
    out: Path = Path("results/uneven/rows.jsonl")
    """A line of JSON for each run; the buildings are drawn beside it. What it holds of the same code already is not run
    again."""

    def run(self) -> None:
        """Run what is to be run, and print the tables."""
        trials = [
            TrialConfig(str(file), self.backend, seed=seed, max_steps=self.max_steps)
            for seed in range(1, self.seeds + 1)
            for file in drawn(self.plans, self.count, self.out.parent)
        ]
        rows = list(rows_of(trials, self.out, self.jobs))
        shown = headed("Uneven apartments", HEAD)
        for row in rows:
            shown.add_row(str(row["world"]), *(_short(row.get(name)) for name in HEAD[1:]))
        plain_console(width=120).print(shown)
        complete = sum(row["status"] == "complete" for row in rows)
        anees = [row["map_anees"] for row in rows if row["map_anees"] is not None]
        print(f"{complete} of {len(rows)} complete; map ANEES: median {np.median(anees):.2f}, mean "
              f"{np.mean(anees):.2f}, highest {np.max(anees):.2f}")  # fmt: skip


def _short(value: str | float | None) -> str:
    return f"{value:.3g}" if isinstance(value, float) else str(value)


def drawn(plans: Path, count: int | None, folder: Path) -> list[Path]:
    """Make every 13th apartment of a folder of plans uneven, up to so many, and return their files in another folder.

    Raises UsageError where there is no apartment.
    """
    files = sorted(plans.glob("lifull_*"))[::EVERY][:count]
    if not files:
        raise UsageError(f"expected a folder of plans, found no lifull_* in {plans}: check it")
    folder.mkdir(parents=True, exist_ok=True)
    return [_drawn(uneven(load_world(str(file)), seed=1), folder) for file in files]


def _drawn(world: World, folder: Path) -> Path:
    """Write a world as GeoJSON and return its file."""
    features = [
        {"type": "Feature", "properties": {"kind": "room"}, "geometry": shapely.geometry.mapping(world.free)},
        {"type": "Feature", "properties": {"kind": "start"},
         "geometry": {"type": "Point", "coordinates": world.start[:2].tolist()}},
    ]  # fmt: skip
    file = folder / f"{world.name}.geojson"
    file.write_text(json.dumps({"type": "FeatureCollection", "features": features}))
    return file


if __name__ == "__main__":
    run_study(UnevenStudy)
