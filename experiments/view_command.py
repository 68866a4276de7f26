"""`chainslam view`: what a run left, in Rerun's viewer."""

import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from viz.viewer import Viewer, ViewerError

from .explore_command import prepare
from .replay import read_run, replay
from .results import LOG, RECORDING
from .scenario import UsageError, load_world
from .timelines import Recording


@dataclass(frozen=True)
class View:
    """Open a recording in Rerun's viewer, or a results folder: its recording, or one made now from its log."""

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")]
    """A .rrd file, a run's log.npz, or a results folder that holds either."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError where there is nothing to open."""
        files = recordings_at(self.path)
        try:
            Viewer(files)
        except ViewerError as error:
            print(f"chainslam: {error}", file=sys.stderr)
            return 1
        print(f"opened {', '.join(map(str, files))}")
        return 0


def recordings_at(path: Path) -> list[Path]:
    """Return the recordings at a place, one made from the log if there is none; raises UsageError."""
    if path.suffix == ".rrd" and path.is_file():
        return [path]
    found = sorted(path.glob("*.rrd")) if path.is_dir() else []
    if found:
        return found
    log = path if path.name == LOG else path / LOG
    if not log.is_file():
        raise UsageError(f"expected a .rrd file, a {LOG} or a folder with one, found {path}: name what a run left")
    return [_made_from(log)]


def _made_from(log: Path) -> Path:
    """Replay a run's log through the back end that made it, and return the recording beside it."""
    run = read_run(log)
    trial, target = run.trial, log.with_name(RECORDING)
    prepare(target.parent)
    world = load_world(trial.world, trial.start, trial.scale)
    title = f"{world.name}: {trial.backend}, seed {trial.seed}, from its log"
    recording = Recording(title, [trial.backend], world, trial.errorless, target)
    replay(run, trial.backend, watch=recording.watch(trial.backend, lambda step: run.true_poses_world[step.index]))
    problems = recording.close()
    if problems:
        raise UsageError(f"expected to record {log.name} beside it, found {problems[0]}: free the place and try again")
    return target
