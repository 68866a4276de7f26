"""How close the factor graph stays to the dense solution, and how long it takes, by its settings.

One run is recorded, and what the graph was told of it is told again under each setting: the same odometry, the same
observations of the same lines, the same questions in between.
"""

import time
from dataclasses import dataclass

import numpy as np
from rich.table import Table

from chainslam.experiments.replays.recordings import record
from chainslam.experiments.replays.replay import ReplayOptions, replay
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.terminal.console import plain_console
from chainslam.slam.backends.graph.config import GraphConfig
from chainslam.slam.backends.graph.graph import Graph
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.robot import Odometry

from ..runner.command import run_study
from .graph import Problem, differences

SETTINGS: dict[str, GraphConfig] = {
    "as it is": GraphConfig(),
    **{f"wildfire {size:g}": GraphConfig(wildfire=size) for size in (0.0, 1e-5, 1e-4, 3e-4, 1e-3, 3e-3)},
    **{
        f"linearised anew at {angle:g} rad, {place:g} m": GraphConfig(
            relinearise_angle_rad=angle, relinearise_place_m=place
        )
        for angle, place in ((0.0025, 0.1), (0.01, 0.2), (0.02, 0.4))
    },
}


def told_again(problem: Problem, config: GraphConfig) -> tuple[Graph, float]:
    """Tell another graph what one was told; return it and the processor time of a step, s.

    After each motion it is asked for the joint covariance of what is seen next, as matching does. New lines are grown
    before the rest is entered: two pieces of one new wall may be in one scan.
    """
    graph = Graph(problem.prior, problem.prior_cov, config)
    seen, lines_seen, seen_from = problem.seen, problem.line, problem.seen_from
    cov = seen[:, [2, 3, 3, 4]].reshape(-1, 2, 2)
    centres = seen[:, 1:2] * normals(seen[:, 0]) + (seen[:, 3] / seen[:, 2])[:, None] * directions(seen[:, 0])
    ids: dict[int, int] = {}
    begin = time.process_time()
    for pose in range(len(problem.odometry) + 1):
        if pose:
            graph.predict(Odometry(problem.odometry[pose - 1], problem.odometry_cov[pose - 1]))
        numbers = np.flatnonzero(seen_from == pose)
        _, firsts = np.unique(lines_seen[numbers], return_index=True)
        new = numbers[[at for at in sorted(firsts) if int(lines_seen[numbers[at]]) not in ids]]
        known = np.setdiff1d(numbers, new)
        belief = graph.belief
        belief.joint(sorted({ids[line] for line in lines_seen[known].tolist() if line in ids}))
        if len(new):
            ids |= zip(
                lines_seen[new].tolist(), graph.grow(seen[new, :2], cov[new], centres[new]).tolist(), strict=True
            )
        matched = np.array([ids[line] for line in lines_seen[known].tolist()], dtype=np.int64)
        observed = Observations(matched, seen[known, :2], cov[known])
        graph.update(observed, observed)
    _ = graph.belief
    return graph, (time.process_time() - begin) / (len(problem.odometry) + 1)


@dataclass(frozen=True)
class SettingsStudy:
    """Print a row for each setting of the graph."""

    world: str = "rooms"
    """A bundled world or a file."""
    seed: int = 2
    """Of the run."""
    max_steps: int = 100_000
    """Of the run; the dense solution takes the cube of it."""

    def run(self) -> None:
        """Record, tell again, compare."""
        run = record(TrialConfig(self.world, "full-ekf", seed=self.seed, max_steps=self.max_steps))
        graph = replay(run, "graph", ReplayOptions("true", perfect_extraction=True)).scenario.backend
        assert isinstance(graph, Graph)
        problem = Problem.of(graph.record)
        table = Table(title=f"{self.world}, seed {self.seed}: {len(problem.odometry)} poses, true association")
        for column in ("", "pose mm", "deg", "line mm", "deg", "sigma", "covariance", "ms a step"):
            table.add_column(column)
        told_again(problem, GraphConfig())  # What is compiled is loaded.
        for words, config in SETTINGS.items():
            again, spent = told_again(problem, config)
            table.add_row(words, *(f"{value:.4f}" for value in differences(again).values()), f"{1e3 * spent:.2f}")
        plain_console().print(table)


if __name__ == "__main__":
    run_study(SettingsStudy)
