"""Rooms with three round pillars beside the same rooms without: what they cost, here and in IR-SIM.

.venv/bin/python -m studies.robots.round_pillars --seeds 5
"""

import importlib.util
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import shapely
import tyro
import yaml
from jaxtyping import Float
from rich.table import Table
from shapely.geometry.polygon import orient

import chainslam
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import run_trial
from chainslam.experiments.views.numbers import number
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import World

EXAMPLES = Path(__file__).parents[2] / "examples"
ROOM, START = shapely.box(0.0, 0.0, 8.0, 6.0), (0.8, 0.8, 0.3)
IRSIM_ROOM, IRSIM_START = shapely.box(0.5, 0.5, 4.5, 6.0), (1.5, 1.5)
"""The room of the example's world that has nothing in it."""


@dataclass(frozen=True)
class RoundPillarsStudy:
    """Explore each room twice with each seed, and print a row for each pair."""

    seeds: int = 5
    """Places and sizes of the pillars, and the noise, by so many seeds."""
    first_seed: int = 1
    """The seed of the first; the others follow it."""
    backend: str = "invariant-ekf"
    """The estimator."""
    beams: int = 180
    """Of the scanner, where it is our own simulator's."""
    irsim: bool = True
    """Whether IR-SIM's rooms are explored, too."""

    def run(self) -> None:
        """Run the study and print its table."""
        shown = Table(title=f"{self.backend}, with and without three round pillars", title_justify="left")
        for column in (
            "simulator",
            "seed",
            "status",
            "steps without",
            "steps with",
            "share",
            "coverage",
            "map ANEES",
            "collisions",
        ):
            shown.add_column(column, justify="right")
        shares = []
        for simulator, seed, without, found in self._pairs():
            shares.append(found["steps"] / without["steps"])
            cells = (simulator, str(seed), found["status"], str(without["steps"]), str(found["steps"]))
            coverage, collisions = found.get("coverage"), found["collisions"]
            shown.add_row(
                *cells,
                f"{shares[-1]:.2f}",
                *(number(each) for each in (coverage, found.get("map_anees"))),
                str(collisions),
            )
        console = plain_console()
        console.print(shown)
        console.print(f"geometric mean of the shares {np.exp(np.mean(np.log(shares))):.2f}, largest {max(shares):.2f}")

    def _pairs(self) -> Iterator[tuple[str, int, dict[str, Any], dict[str, Any]]]:
        for seed in range(self.first_seed, self.first_seed + self.seeds):
            discs = pillars(seed, ROOM, START, 0.9)
            holes = [_disc(each).exterior.coords for each in discs]
            rooms = (ROOM, shapely.Polygon(ROOM.exterior.coords, holes))
            without, found = (self._here(orient(room), seed) for room in rooms)
            yield "own", seed, without, found
        for seed in range(self.first_seed, self.first_seed + self.seeds * self.irsim):
            discs = pillars(seed, IRSIM_ROOM, IRSIM_START, 0.55)
            without, found = (self._in_irsim(each, seed) for each in (np.empty((0, 3)), discs))
            yield "IR-SIM", seed, without, found

    def _here(self, room: shapely.Polygon, seed: int) -> dict[str, Any]:
        world = World("round-pillars", room, np.array(START), {})
        robot = RobotConfig(lidar=LidarConfig(beams=self.beams))
        trial = TrialConfig(world.name, self.backend, seed=seed, max_steps=2000, robot=robot)
        return run_trial(trial, world=world).summary

    def _in_irsim(self, discs: Float[np.ndarray, "n 3"], seed: int) -> dict[str, Any]:
        spec = importlib.util.spec_from_file_location("irsim_robot", EXAMPLES / "irsim_robot.py")
        assert spec is not None
        assert spec.loader is not None
        adaptor = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(adaptor)
        said = yaml.safe_load((EXAMPLES / "irsim_room.yaml").read_text())
        said["obstacle"] += [
            {"state": [x, y, 0.0], "shape": {"name": "circle", "radius": radius}} for x, y, radius in discs.tolist()
        ]
        with tempfile.TemporaryDirectory() as folder:
            path = Path(folder) / "room.yaml"
            path.write_text(yaml.safe_dump(said))
            robot = adaptor.IrSimRobot(path, seed=seed)
        found = chainslam.explore(robot, robot=robot.spec, backend=self.backend, max_steps=2000).summary
        return {**found, "collisions": int(robot.collided)}


def pillars(seed: int, room: shapely.Polygon, start: tuple[float, ...], apart_m: float) -> Float[np.ndarray, "3 3"]:
    """Return place and radius, m, of three round pillars with ways between them, and around the start."""
    chance = np.random.default_rng(seed)
    low, high = np.reshape(room.bounds, (2, 2))
    while True:
        discs = np.column_stack([chance.uniform(low, high, (3, 2)), chance.uniform(0.15, 0.4, 3)])
        shapes = [_disc(each) for each in discs]
        others = (room.exterior, shapely.Point(start[:2]))
        gaps = [shape.distance(other) for k, shape in enumerate(shapes) for other in (*others, *shapes[:k])]
        if min(gaps) >= apart_m:
            return discs


def _disc(place: Float[np.ndarray, "3"]) -> shapely.Polygon:
    return shapely.Point(place[:2]).buffer(place[2])


if __name__ == "__main__":
    tyro.cli(RoundPillarsStudy, description=__doc__).run()
