"""Doors hardly wider than the body: whether the robot gets through, and whether it touches their posts.

.venv/bin/python -m studies.robots.doors
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import shapely
from rich.table import Table
from shapely import affinity

from chainslam.experiments.campaign.workers import on_workers
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import run_trial
from chainslam.sim.worlds import World
from chainslam.slam.geometry.poses import rotation

from ..runner.command import run_study

Case = tuple[float, float, int]
AT_M, WALL_M, BEYOND_M = 2.4, 0.1, 2.8
"""The wall with the door, and where the robot is through, from the edge of the room."""


@dataclass(frozen=True)
class DoorStudy:
    """Explore two rooms with a door between them, turned in the plane, and print a row for each width."""

    widths_m: tuple[float, ...] = (0.41, 0.417, 0.425, 0.431, 0.434, 0.442, 0.45, 0.46)
    """Of the door; the body is 0.4 m wide."""
    turns_deg: tuple[float, ...] = (0.0, 13.0, 25.7, 37.0, 72.7)
    """Of the building against the axes of the grid."""
    seeds: int = 4
    """Runs for each width and turn."""
    backend: str = "invariant-ekf"
    """The estimator."""
    jobs: int = 2
    """Number of processes."""

    def run(self) -> None:
        """Run the study and print its table."""
        shown = Table(title="doors", title_justify="left")
        for column in ("width, m", "runs", "through", "with a contact", "steps, mean"):
            shown.add_column(column, justify="right")
        for width in self.widths_m:
            cases = [(width, turn, seed) for turn in self.turns_deg for seed in range(1, self.seeds + 1)]
            found = list(on_workers(self._one, _lost, self.jobs)(cases))
            through, contacts, steps = np.array(found).T
            shown.add_row(
                f"{width:g}", str(len(found)), f"{through.sum():g}", f"{np.sum(contacts > 0):g}", f"{steps.mean():.0f}"
            )
        plain_console().print(shown)

    def _one(self, case: Case) -> Sequence[float]:
        """Return whether the robot got through, its contacts, and its steps."""
        width_m, turn_deg, seed = case
        config = TrialConfig("door", self.backend, seed=seed, max_steps=800)
        result = run_trial(config, world=world_with(width_m, turn_deg))
        assert result.log is not None
        right = np.array([np.cos(np.deg2rad(turn_deg)), np.sin(np.deg2rad(turn_deg))])
        far_m = float(np.max(result.log.true_world[:, :2] @ right))
        return far_m > BEYOND_M, result.summary["collisions"], result.summary["steps"]


def world_with(width_m: float, turn_deg: float) -> World:
    """Return two rooms with a door between them."""
    posts = [shapely.box(AT_M, 0.0, AT_M + WALL_M, 1.23), shapely.box(AT_M, 1.23 + width_m, AT_M + WALL_M, 4.0)]
    drawn = shapely.box(0.0, 0.0, 5.0, 4.0).difference(shapely.union_all(posts))
    free = affinity.rotate(drawn, turn_deg, origin=(0.0, 0.0))
    start = rotation(float(np.deg2rad(turn_deg))) @ np.array([0.5, 0.5])
    turned = shapely.orient_polygons(free)
    assert isinstance(turned, shapely.Polygon)
    return World("door", turned, np.append(start, 0.0), {})


def _lost(case: Case, reason: str) -> Sequence[float]:
    raise RuntimeError(f"expected a run of {case}, found none: {reason}")


if __name__ == "__main__":
    run_study(DoorStudy)
