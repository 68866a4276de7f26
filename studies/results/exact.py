"""What a mapper errs by where nothing is wrong with its input: exact ranges, exact wheels, the stated noise kept.

Whatever moves the pose is then an error of its own, or the mending of one. Each such movement is put down to the
observation that lies farthest, by what is stated of it, from the true line of the wall that it was fused into.

.venv/bin/python -m studies.results.exact --plans ../shared/data/plans   # goes on where it was interrupted
.venv/bin/python -m studies.results.exact --worlds paper-fig5 depot.yaml --backend graph
"""

from collections import Counter
from dataclasses import dataclass, field
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np
from rich.table import Table

from chainslam.experiments.scenario import Scenario, TrialConfig, build
from chainslam.experiments.scoring.association import Votes
from chainslam.experiments.scoring.beam_votes import vote
from chainslam.experiments.scoring.truth import truth_of
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.trial import default_mission, run_scenario
from chainslam.experiments.usage import UsageError
from chainslam.explore.step import Step
from chainslam.sim.worlds import WORLDS
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import compose, wrap
from chainslam.slam.map.reliability import as_told

from ..runner.command import run_study
from ..runner.rows import Row, rows_of

NAMES = ("world", "backend", "max_steps")
AIM_M = 0.005
"""Root mean square of the pose's error that was asked for."""
JUMP_M = 0.001
"""A pose that one scan moves by more has jumped; a turn by a milliradian counts as much, as a metre away it does."""
EXACT = 0.01
"""Squared distance, in what is stated of it, below which an observation is right: another one was wrong before."""
SCORES = ("status", "reason", "steps", "coverage", "false_matches", "false_matches_few_beams", "false_merges")


@dataclass
class Movements:
    """How far the pose was moved by each cause, and the first step at which it jumped."""

    scenario: Scenario
    votes: Votes
    moved_m: dict[str, float] = field(default_factory=dict)
    jumped: dict[str, Any] | None = None
    beyond_step: int | None = None
    """The first step with an error beyond `AIM_M`."""
    _before: np.ndarray | None = None

    def __call__(self, step: Step) -> None:
        """Take note of one step."""
        record, pose = self.scenario.robot.record, step.pose_world
        for keep, drop in step.merged:
            self.votes.merge(keep, drop)
        self.votes.add(step.segments, step.walls_of_segments, record.faces_of_beams[-1], step.matches.pairs)
        if self._before is not None:
            predicted = compose(self._before, step.odometry.reported.motion)
            moved = float(np.hypot(np.hypot(*(pose - predicted)[:2]), wrap(pose[2] - predicted[2])))
            told = self._worst_observation(step)
            self.moved_m[told["cause"]] = self.moved_m.get(told["cause"], 0.0) + moved
            if moved > JUMP_M and self.jumped is None:
                self.jumped = {"step": step.index, "moved_m": moved} | told
        if self.beyond_step is None and np.hypot(*(pose - record.poses_world[-1])[:2]) > AIM_M:
            self.beyond_step = step.index
        self._before = pose.copy()

    def _worst_observation(self, step: Step) -> dict[str, Any]:
        """Return the matched segment that is farthest off its wall's true line by what it states, and why it is."""
        pairs, truth, beams = step.matches.pairs, self.votes.truth, self.scenario.robot.record.faces_of_beams[-1]
        if step.localisation.unstated_motion is not None:
            return {"cause": "unstated motion"}
        faces = self.votes.faces_of(pairs[:, 1])
        pairs, faces = pairs[faces >= 0], faces[faces >= 0]
        if not len(pairs):
            return {"cause": "no match"}
        seen = step.segments.take(pairs[:, 0])
        pose = self.scenario.robot.record.poses_world[-1]
        r = truth.lines[faces, 1] - normals(truth.lines[faces, 0]) @ pose[:2]
        true = np.stack([truth.lines[faces, 0] - pose[2], r], axis=-1)
        off = seen.lines - true
        off[:, 0] = wrap(off[:, 0])
        cov = as_told(seen.cov, seen, self.scenario.config.mission.mapper.walls.reliability)
        squared = np.einsum("ki,kij,kj->k", off, np.linalg.inv(cov), off)
        k = int(np.argmax(squared))
        told = vote(seen.beams[k].tolist(), beams, truth.walls)
        cause = "earlier" if squared[k] < EXACT else "two faces"
        if cause != "earlier" and len(np.unique(truth.walls[told.faces])) == 1:
            cause = "false match" if told.wall != truth.walls[faces[k]] else "uneven wall"
        few = " of few beams" if seen.is_tentative[k] and cause != "earlier" else ""
        across = np.vecdot(normals(true[k, 0]), seen.ends[k].mean(axis=0)) - true[k, 1]
        return {
            "cause": cause + few, "wall": int(pairs[k, 1]), "beams": int(seen.beam_counts[k]),
            "on_its_wall": told.on_winner, "length_m": float(seen.lengths_m[k]), "off_m": float(across),
            "turn_rad": float(off[k, 0]), "squared": float(squared[k]),
            "true_wall": int(truth.walls[faces[k]]), "seen_wall": told.winner,
        }  # fmt: skip


def exact(backend: str, max_steps: int, world: str) -> list[Row]:
    """Drive through one world errorless and return its row."""
    known = {"world": Path(world).name, "backend": backend, "max_steps": max_steps}
    try:
        scenario = build(TrialConfig(world, backend, errorless=True, max_steps=max_steps))
    except UsageError as error:
        return [known | {"status": "not loaded", "reason": str(error)}]
    movements = Movements(scenario, Votes(truth_of(scenario.world, scenario.config.robot)))
    result = run_scenario(scenario, movements, default_mission)
    row = known | {key: result.summary[key] for key in SCORES}
    if result.log is None:
        return [row]
    off = result.log.estimated_world - result.log.true_world
    away = np.hypot(off[:, 0], off[:, 1])
    grown = np.diff(away, prepend=away[0])
    row |= {
        "pose_rms_m": float(np.sqrt(np.mean(away**2))), "pose_worst_m": float(away.max()),
        "heading_rms_rad": float(np.sqrt(np.mean(wrap(off[:, 2]) ** 2))),
        "worst_step": int(np.argmax(grown)), "worst_step_m": float(grown.max()),
        "beyond_step": movements.beyond_step, "jumped": movements.jumped, "moved_m": movements.moved_m,
    }  # fmt: skip
    return [row]


@dataclass(frozen=True)
class Exact:
    """Drive worlds errorless, and print what the pose errs by, which matches are false, and where it begins."""

    worlds: tuple[str, ...] = tuple(WORLDS)
    """Bundled names or files."""
    plans: Path | None = None
    """A folder of maps, driven beside these worlds."""
    named: str = "*.json"
    """Which files of the folder."""
    every: int = 4
    """Every so many of them by name."""
    backend: str = "invariant-ekf"
    """The estimator."""
    max_steps: int = 1500
    """A drive stops here."""
    jobs: int = 1
    """Number of processes."""
    out: Path = Path("results/exact.jsonl")
    """A line of JSON for each world, as it ends. What it holds of the same code is not run again."""

    def run(self) -> None:
        """Run what is to be run and print the tables; raises UsageError."""
        worlds = list(self.worlds)
        if self.plans is not None:
            found = sorted(self.plans.glob(self.named))[:: self.every]
            if not found:
                raise UsageError(f"expected maps in {self.plans}, found no file {self.named}: check it")
            worlds += map(str, found)
        tasks = [(world, [(Path(world).name, self.backend, self.max_steps)]) for world in worlds]
        rows = list(rows_of(self.out, NAMES, tasks, partial(exact, self.backend, self.max_steps), self.jobs))
        plain_console(width=150).print(table(rows), causes(rows))


def table(rows: list[Row]) -> Table:
    """Return a row for each world, and which of them reach what was asked for."""
    shown = Table(title_justify="left")
    columns = "world|steps|pose rms mm|worst|false|few beams|jumps at|by mm|cause|beams|off mm|turn mrad"
    for column in columns.split("|"):
        shown.add_column(column, justify="left" if column in ("world", "cause") else "right")
    driven = [row for row in rows if "pose_rms_m" in row]
    held = [row for row in driven if row["pose_rms_m"] < AIM_M and not _false(row)]
    false = sum(map(_false, driven))
    shown.title = f"{len(held)} of {len(rows)} below 5 mm and without a false match; false matches {false}"
    for row in rows:
        name = Path(row["world"]).stem
        if row not in driven:
            shown.add_row(name, row["status"], row["reason"])
            continue
        jumped = row["jumped"] or {}
        shown.add_row(
            name, str(row["steps"]), f"{1e3 * row['pose_rms_m']:.2f}", f"{1e3 * row['pose_worst_m']:.1f}",
            str(_false(row)), str(row["false_matches_few_beams"]), str(jumped.get("step", "-")),
            _thousandth(jumped, "moved_m"), jumped.get("cause", "-"), str(jumped.get("beams", "-")),
            _thousandth(jumped, "off_m"), _thousandth(jumped, "turn_rad"),
        )  # fmt: skip
    return shown


def causes(rows: list[Row]) -> Table:
    """Return by how much each cause moved poses, and in how many worlds it did so first."""
    shown = Table(title="What moved the pose, m and rad", title_justify="left")
    for column in ("cause", "moved", "first in worlds"):
        shown.add_column(column, justify="left" if column == "cause" else "right")
    moved, first = Counter[str](), Counter[str]()
    for row in rows:
        moved.update(row.get("moved_m", {}))
        first.update([row["jumped"]["cause"]] if row.get("jumped") else [])
    for cause, sum_m in moved.most_common():
        shown.add_row(cause, f"{sum_m:.3f}", str(first[cause]))
    return shown


def _false(row: Row) -> int:
    return int(row["false_matches"]) - int(row["false_matches_few_beams"])


def _thousandth(jumped: dict[str, Any], key: str) -> str:
    return f"{1e3 * jumped[key]:.1f}" if key in jumped else "-"


if __name__ == "__main__":
    run_study(Exact)
