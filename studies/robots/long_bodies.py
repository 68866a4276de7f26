"""A long body and two rooms with a door between them: whether it passes doors that it fits through.

.venv/bin/python -m studies.robots.long_bodies
"""

from dataclasses import dataclass

import numpy as np
import shapely
import tyro
from rich.table import Table
from shapely.geometry.polygon import orient

from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import run_trial
from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import World

LENGTH_M, HALF_WIDTH_M = 0.8, 0.2
CASES = ((0.6, 0.4, 1), (0.5, 0.4, 1), (0.5, 0.6, 2), (0.47, 0.2, 3), (0.47, 0.4, 4))
"""Width of the door m, how far the axle is from the back m, and the seed."""


@dataclass(frozen=True)
class LongBodiesStudy:
    """Explore both rooms in each case, and print a row for each."""

    backend: str = "full-ekf"
    """The estimator."""
    max_steps: int = 300
    """A run is stopped after this many scans."""

    def run(self) -> None:
        """Run the study and print its table."""
        shown = Table(title="A body of 0.8 by 0.4 m", title_justify="left")
        for column in ("door m", "axle from the back m", "seed", "status", "steps", "coverage", "collisions"):
            shown.add_column(column, justify="right")
        for door_m, back_m, seed in CASES:
            robot, world = RobotConfig(outline_m=outline(back_m)), two_rooms(door_m)
            trial = TrialConfig(world.name, self.backend, seed=seed, max_steps=self.max_steps, robot=robot)
            found = run_trial(trial, world=world).summary
            cells = (found["status"], found["steps"], f"{found['coverage']:.3f}", found["collisions"])
            shown.add_row(*map(str, (door_m, back_m, seed, *cells)))
        plain_console().print(shown)


def outline(back_m: float) -> tuple[tuple[float, float], ...]:
    """Return the corners of the body whose axle is so far from its back, m."""
    ahead_m = LENGTH_M - back_m
    return (ahead_m, HALF_WIDTH_M), (-back_m, HALF_WIDTH_M), (-back_m, -HALF_WIDTH_M), (ahead_m, -HALF_WIDTH_M)


def two_rooms(door_m: float) -> World:
    """Return two rooms of 3 by 4 m with a door of this width in the wall between them."""
    wall = shapely.union_all([shapely.box(3.0, -0.1, 3.1, 2.0), shapely.box(3.0, 2.0 + door_m, 3.1, 4.1)])
    rooms = shapely.box(0.0, 0.0, 6.1, 4.0).difference(wall)
    assert isinstance(rooms, shapely.Polygon)
    return World("two-rooms", orient(rooms), np.array([1.2, 1.0, 0.4]), {})


if __name__ == "__main__":
    tyro.cli(LongBodiesStudy, description=__doc__).run()
