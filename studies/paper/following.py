"""The paper's wall following beside viewpoints: its figures over seeds, and what the paper's shortcut costs with each.

.venv/bin/python -m studies.paper.following --jobs 2      # goes on where it was interrupted
"""

from collections import Counter
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from itertools import product
from pathlib import Path
from typing import Any, get_args

import numpy as np

from chainslam.experiments.artifacts.presets import METHODS
from chainslam.experiments.artifacts.settings import FOLLOWING, nested, over, trial_of
from chainslam.experiments.reproductions.runs.traversals import passes
from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.trial import TrialResult, run_trial
from chainslam.explore.following.behaviour import Behaviour
from chainslam.explore.following.wall_following import Following

from ..runner.command import run_study
from ..runner.rows import Row, rows_of

ROWS = Path("studies/paper/following.jsonl")
NAMES = ("part", "figure", "following", "strategy", "backend", "errorless", "seed")
FIGURES: Mapping[str, tuple[str, str]] = {
    "fig4": ("paper-fig4", "nearest-robot"),
    "fig5": ("paper-fig5", "nearest-robot"),
    "fig6": ("paper-fig5", "nearest-start"),
    "fig8": ("paper-fig8", "nearest-robot"),
    "fig9": ("paper-fig9", "nearest-robot"),
}
"""The world and the strategy of each figure."""
BY_METHOD, BY_BACKEND = "figures", "shortcut"
"""The two parts: the figures driven by the preset, and the back ends under today's mapper."""
COMPARED = ("fig8", "fig9")
STRATEGIES = ("nearest-robot", "same-chain", "nearest-start")
BACKENDS = ("block-ekf", "full-ekf", "graph")
METHOD = METHODS["paper-method"]
DRIVING = ("approach", "follow", "round", "reverse")
"""What the paper's following layer does."""
KEPT = (
    *("status", "reason", "steps", "path_length_m", "contours_closed", "contours_reachable", "coverage", "collisions"),
    *("pose_rmse_m", "pose_anees", "map_anees", "duplicate_lines", "false_matches"),
)
Task = tuple[str, str, str, str, str, bool, int]


@dataclass(frozen=True)
class FollowingStudy:
    """Drive the paper's figures with each following, and three strategies with three back ends."""

    seeds: int = 10
    """Noisy drives of each figure; they have one without errors besides."""
    compared: int = 6
    """Of these seeds, so many with every strategy and back end."""
    first_seed: int = 1
    """The first of these seeds."""
    max_steps: int = 6000
    """A run is stopped after this many scans."""
    jobs: int = 1
    """Number of processes."""
    out: Path = ROWS
    """A line of JSON for each run, as it ends. What it holds of the same code already is not run again."""

    def tasks(self) -> list[Task]:
        """Return what each run is known by, in the order in which they are made: without errors, then seed by seed."""
        ways = get_args(Following)
        backend = METHOD.backend
        found: list[Task] = [
            (BY_METHOD, figure, way, FIGURES[figure][1], backend, True, 1) for figure, way in product(FIGURES, ways)
        ]
        for seed in range(self.first_seed, self.first_seed + self.seeds):
            found += [
                (BY_METHOD, figure, way, FIGURES[figure][1], backend, False, seed)
                for figure, way in product(FIGURES, ways)
            ]
            if seed < self.first_seed + self.compared:
                found += [
                    (BY_BACKEND, figure, way, strategy, name, False, seed)
                    for figure, way, strategy, name in product(COMPARED, ways, STRATEGIES, BACKENDS)
                ]
        return found

    def run(self) -> None:
        """Run what is to be run; raises UsageError for a file of something else."""
        tasks = self.tasks()
        for task in tasks:
            check(trial(task, self.max_steps))
        numbered = [(task, [task]) for task in tasks]
        rows = list(rows_of(self.out, NAMES, numbered, partial(_one, self.max_steps), self.jobs))
        print(f"{len(rows)} rows in {self.out}; `make results` makes their tables")


def trial(task: Task, max_steps: int) -> TrialConfig:
    """Return the settings of a run: those of the preset, or today's mapper driven as the preset drives."""
    part, figure, following, strategy, backend, errorless, seed = task
    settings = METHOD.record if part == BY_METHOD else nested(METHOD.driving)
    own = {"world": FIGURES[figure][0], "strategy": strategy, "backend": backend, "errorless": errorless, "seed": seed}
    return trial_of(over(settings, nested([(FOLLOWING, following)])), own | {"max_steps": max_steps})


def _one(max_steps: int, task: Task) -> Sequence[Row]:
    result = run_trial(trial(task, max_steps))
    return [dict(zip(NAMES, task, strict=True)) | scores(result)]


def scores(result: TrialResult) -> Row:
    """Return what a run came to, what its steps were spent on, and where it led."""
    row: dict[str, Any] = {name: _short(result.summary.get(name)) for name in KEPT}
    log = result.log
    if log is None:
        return row
    closed = np.flatnonzero(log.closed_chains > 0)
    counts = Counter(log.behaviours)
    return row | {
        "first_closed_m": _short(float(log.path_length_m[closed[0]])) if len(closed) else None,
        "start_passes": passes(log.true_world),
        "longest_route": int(log.route_walls.max()),
        "behaviours": {word.value: counts[word.value] for word in Behaviour if counts[word.value]},
    }


def _short(value: Any) -> Any:
    return float(f"{value:.5g}") if isinstance(value, float) else value


if __name__ == "__main__":
    run_study(FollowingStudy)
