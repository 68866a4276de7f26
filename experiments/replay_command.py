"""`chainslam replay`: one recording, one or several back ends."""

from dataclasses import dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from slam.backends import BACKENDS

from .explore_command import prepare
from .progress import print_comparison, progress
from .replay import Association, ReplayOptions, read_run, replay
from .results import write_results
from .scenario import choose


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
        summaries, status = [], 0
        for name, folder in folders.items():
            with progress(f"replaying with {name}") as watch:
                result = replay(run, name, options, watch)
            problems = write_results(result, folder)
            summaries.append(result.summary)
            status = max(status, result.ending.exit_status, 1 if problems else 0)
        print_comparison(summaries, f"{run.trial.world}, seed {run.trial.seed}, {self.association} association")
        print(f"results in {out}")
        return status
