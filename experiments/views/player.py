"""Runs of one drive as a film for the player: truth, estimates and what they state of their errors, step by step.

`python -m chainslam.experiments.views.player DIR ... --out FILM.json` takes the folders of runs of one drive. The log
of each is replayed for its map at each step; the scores are those of its files. At most `FRAMES` steps are shown: every
n-th, and the last. A wall is told again at a step only if it has changed by `MOVED_MM` or `WIDENED` since it was told
last; the last step has every wall as it is.
"""

import json
import sys
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import numpy as np
import tyro
from jaxtyping import Float, Int

from chainslam.explore.step import Step
from chainslam.slam.estimation.backend import POSE, Joint
from chainslam.slam.evaluation.consistency import chi2_band, share_in_band
from chainslam.slam.geometry.poses import to_world, wrap

from ..artifacts.files import CONFIG, write
from ..artifacts.results import LOG
from ..artifacts.saved import read_summary
from ..replays.replay import RecordedRun, is_same_drive, read_options, read_run, replay
from ..scenario import load_world
from ..scoring.maps.coverage import alignment
from ..terminal.progress import progress
from ..usage import UsageError
from .pictures import BAD_USAGE, POSE_DOF, read_steps
from .timelines import true_rings

FORMAT = 1
FRAMES = 200
MOVED_MM, WIDENED = 5.0, 0.2
"""By how much the end of a wall has moved, or the standard deviation there has changed, when it is told again."""
MM = 1e3
"""In a metre; as many mrad are in a radian."""
SAME_M = 1e-3
"""A replay that differs by less from the stored path draws the same picture."""


def film_of(homes: Sequence[Path]) -> dict[str, Any]:
    """Return the film of the runs of one drive from their folders, ready to be written as JSON.

    Lengths are in mm, angles in mrad, variances in mm², path lengths in m. Poses are relative to the true start, as
    `pose_nees_from_start` scores them, and walls are moved accordingly. Raises UsageError for folders without the truth
    or of several drives, and where a replay does not repeat the run.
    """
    runs = [read_run(home / LOG) for home in homes]
    if not runs or not all(is_same_drive(runs[0], run) for run in runs):
        raise UsageError("expected runs of one drive, found several or none: name the folder of one run or replay")
    first = runs[0]
    world, shown = (
        load_world(first.trial.world, first.trial.start, first.trial.drawing),
        shown_steps(len(first.recording)),
    )
    if not shown:
        raise UsageError(f"expected a run of at least one step, found none in {homes[0]}: name another")
    return {
        "format": FORMAT,
        "title": f"{world.name}, seed {first.trial.seed}",
        "steps": shown,
        "path_m": np.round(read_steps(homes[0])[shown, 4], 2).tolist(),
        "band": [_digits(end) for end in chi2_band(POSE_DOF)],
        "radius": round(MM * first.trial.robot.radius_m),
        "floor": [np.rint(MM * ring).astype(int).ravel().tolist() for ring in true_rings(world)],
        "true": _poses(first.true_poses_world[shown]),
        "runs": [_filmed(home, run, shown) for home, run in zip(homes, runs, strict=True)],
    }


def shown_steps(count: int) -> list[int]:
    """Return which steps of a run are shown: every n-th, `FRAMES` or fewer, and the last."""
    return sorted({*range(0, count, -(-count // (FRAMES - 1))), count - 1}) if count else []


def deviations(joint: Joint, extents: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
    """Return the standard deviation across each wall at both of its ends, m: of d - s alpha at s along the line."""
    n = len(extents)
    blocks = joint.cov[POSE:, POSE:].reshape(n, 2, n, 2)[np.arange(n), :, np.arange(n), :]
    a, b, c = blocks[:, 0, 0, None], blocks[:, 0, 1, None], blocks[:, 1, 1, None]
    return np.sqrt(np.maximum(c - 2.0 * extents * b + extents**2 * a, 0.0))


def _filmed(home: Path, run: RecordedRun, shown: Sequence[int]) -> dict[str, Any]:
    summary, steps = read_summary(home), read_steps(home)
    walls = _Walls(shown, alignment(run.start_pose, run.true_poses_world[0]))
    with progress(f"{run.trial.backend}: film", float(len(run.recording))) as show:

        def watch(step: Step) -> None:
            show(step)
            walls.add(step)

        log = replay(run, run.trial.backend, read_options(home / CONFIG), watch).log
    if log is None or len(log) != len(steps) or np.abs(log.estimated_world - steps[:, :3]).max() > SAME_M:
        raise UsageError(
            f"expected the log in {home} to give the stored path again, found another (the world or the software has"
            " changed): repeat the run"
        )
    # Without noise the errors are no draws from the stated covariance, and the summary has no ANEES either.
    nees, curve = np.full(len(steps), np.nan) if run.trial.errorless else steps[:, 3], summary["coverage_curve"]
    mapped = np.searchsorted(curve["path_length_m"], steps[shown, 4], side="right") - 1
    covs = MM**2 * log.from_start_cov[shown]
    return {
        "backend": run.trial.backend,
        "anees": _digits(summary["pose_anees_from_start"]),
        "in_band": _digits(share_in_band(nees, POSE_DOF)) if np.isfinite(nees).all() else None,
        "nees": [_digits(value) for value in nees[shown]],
        "coverage": [_digits(curve["coverage"][k]) for k in mapped],
        "poses": _poses(log.from_start_world[shown]),
        "covs": [[_digits(value) for value in (cov[0, 0], cov[0, 1], cov[1, 1])] for cov in covs],
        "walls": walls.changes,
    }


class _Walls:
    """Keeps, for each step shown, the walls that have changed since they were told last, and those that are gone."""

    def __init__(self, shown: Sequence[int], to_true: Float[np.ndarray, "3"]) -> None:
        self.changes: list[list[list[int]]] = []
        self._shown, self._last, self._to_true = set(shown), shown[-1], to_true
        self._told: dict[int, Int[np.ndarray, 7]] = {}

    def add(self, step: Step) -> None:
        if step.index not in self._shown:
            return
        walls, least = step.map, 0.0 if step.index == self._last else 1.0
        ends = to_world(walls.ends_world.reshape(-1, 2), self._to_true).reshape(-1, 4)
        sigmas = deviations(walls.belief.joint(walls.ids), walls.extents)
        rows = np.rint(np.hstack([MM * ends, MM * sigmas, walls.tentative[:, None]])).astype(np.int64)
        now = dict(zip(walls.ids.tolist(), rows, strict=True))
        gone = sorted(self._told.keys() - now.keys())
        told = {wall: row for wall, row in now.items() if _change(self._told.get(wall), row) > least}
        self._told = {wall: row for wall, row in self._told.items() if wall in now} | told
        self.changes.append([*([wall, *row.tolist()] for wall, row in told.items()), *([wall] for wall in gone)])


def _change(before: Int[np.ndarray, "7"] | None, now: Int[np.ndarray, "7"]) -> float:
    """Return by how much a wall has changed, in units of what is told; infinity for a new one or a newly confirmed."""
    if before is None or before[6] != now[6]:
        return np.inf
    moved, widened = np.abs(now - before), np.abs(now[4:6] - before[4:6]) / np.maximum(before[4:6], 1)
    return float(max(moved[:4].max() / MOVED_MM, widened.max() / WIDENED))


def _poses(poses: Float[np.ndarray, "f 3"]) -> list[list[int] | None]:
    """Return poses in mm, mm and mrad; None where there is none."""
    rows = MM * np.column_stack([poses[:, :2], wrap(poses[:, 2])])
    return [np.rint(row).astype(int).tolist() if np.isfinite(row).all() else None for row in rows]


def _digits(value: float | None) -> float | None:
    """Return a number with four digits; None for none."""
    return None if value is None or not np.isfinite(value) else float(f"{value:.4g}")


@dataclass(frozen=True)
class Film:
    """Write the film of the runs of one drive, as the site's player shows it."""

    runs: Annotated[tyro.conf.Positional[tuple[Path, ...]], tyro.conf.arg(metavar="DIR")]
    """Folders of the runs."""
    out: Path
    """File for the film."""


def main() -> int:
    """Run the command and return its exit status."""
    asked = tyro.cli(Film)
    try:
        write(asked.out, json.dumps(film_of(asked.runs), separators=(",", ":")).encode() + b"\n")
    except UsageError as error:
        print(f"player: {error}", file=sys.stderr)
        return BAD_USAGE
    return 0


if __name__ == "__main__":
    sys.exit(main())
