"""`chainslam replay`: one recording, one or several back ends."""

import sys
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from slam.backends import BACKENDS

from .explore_command import prepare
from .progress import print_comparison, progress
from .replay import Association, ReplayOptions, read_run, replay
from .results import write_results
from .scenario import choose, load_world
from .timelines import Recording


@dataclass(frozen=True)
class Replay:
    """Send a run's own log through one or several back ends: identical scans, the back end alone."""

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """The log.npz that a run left, with its config.json beside it."""
    backend: tuple[str, ...] = field(default_factory=lambda: ("full-ekf",))
    """The estimators (see `chainslam backends`)."""
    association: Association = "own"
    """Whose matches: the back end's own gate, or the truth."""
    perfect_extraction: bool = False
    """True lines with noise drawn from exactly the stated covariance, in place of what was fitted."""
    perfect_odometry: bool = False
    """The true motions in place of what the wheels reported; the stated covariance stays."""
    out: Path | None = None
    """Folder for the results, one folder for each of several back ends; by default replay-ASSOCIATION beside LOG."""
    rrd: Path | None = None
    """Record all back ends, side by side on one time axis, for Rerun's viewer (`chainslam view FILE` opens it)."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        for name in self.backend:
            choose("back end", name, BACKENDS)
        run = read_run(self.log)
        out = self.out or self.log.parent / f"replay-{self.association}"
        options = ReplayOptions(self.association, self.perfect_extraction, self.perfect_odometry)
        folders = {name: out / name if len(self.backend) > 1 else out for name in self.backend}
        for folder in folders.values():
            prepare(folder)
        trial = run.trial
        world = load_world(trial.world, trial.start, trial.scale)
        title = f"{world.name}, seed {trial.seed}, replayed with {self.association} association"
        recording = Recording(title, self.backend, world, trial.errorless, self.rrd)
        summaries, problems, status = [], [], 0
        for name, folder in folders.items():
            with progress(f"replaying with {name}") as watch:
                recorded = recording.watch(name, lambda step: run.true_poses_world[step.index], watch)
                result = replay(run, name, options, recorded)
            problems += write_results(result, folder, asdict(options))
            summaries.append(result.summary)
            status = max(status, result.ending.exit_status)
        problems += recording.close()
        print_comparison(summaries, f"{run.trial.world}, seed {run.trial.seed}, {self.association} association")
        print(f"results in {out}")
        for problem in problems:
            print(f"chainslam: not written: {problem}", file=sys.stderr)
        return status or (1 if problems else 0)
