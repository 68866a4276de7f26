"""`chainslam view`: the results of a run in Rerun's viewer."""

import socket
import sys
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from chainslam.viz.viewer import Viewer, ViewerError, WebViewer, available

from ..artifacts.results import LOG, RECORDING
from ..artifacts.run_folder import prepare
from ..campaign.pages.film import record_campaign
from ..campaign.store import read_campaigns
from ..replays.replay import RecordedRun, ReplayOptions, is_same_drive, read_options, read_run, replay
from ..scenario import load_world
from ..terminal.answers import found
from ..terminal.console import say
from ..usage import UsageError
from ..views.timelines import TimelineOutput

TRIALS = "trials.csv"
"""A folder with this file is that of a campaign."""


@dataclass(frozen=True)
class View:
    """Open a recording in Rerun's viewer, or that of a results folder, which is made if there is none.

    It is made from a run's log, from the logs of several back ends that replayed one run, or from a campaign's tables.
    """

    path: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="PATH")]
    """A .rrd file, a run's log.npz, or the folder of `explore`, `replay` or `compare`."""

    web: bool = False
    """Serve the viewer to a browser on this machine until Ctrl-C; `ssh -L` forwards it to another."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError where there is nothing to open."""
        recordings = recordings_at(self.path)
        try:
            if self.web:
                return _serve(recordings())
            available()
            files = recordings()
            Viewer(files)
        except ViewerError as error:
            print(f"chainslam: {error}", file=sys.stderr)
            return 1
        found(opened=[str(file) for file in files])
        print(f"opened {', '.join(map(str, files))}")
        return 0


def _serve(files: list[Path]) -> int:
    """Serve recordings to a browser until the process is stopped; raises ViewerError."""
    viewer = WebViewer(files)
    page, data = viewer.page_port, viewer.port
    found(url=viewer.url)
    say(f"open {viewer.url}")
    say(f"from another machine first: ssh -L {page}:127.0.0.1:{page} -L {data}:127.0.0.1:{data} {socket.gethostname()}")
    say("stop it with Ctrl-C")
    try:
        viewer.wait()
    except KeyboardInterrupt:
        viewer.close()
    return 0


def recordings_at(path: Path) -> Callable[[], list[Path]]:
    """Return a function that gives the recordings at a path, made if there are none; raises UsageError."""
    if path.suffix == ".rrd" and path.is_file():
        return lambda: [path]
    found = sorted(path.glob("*.rrd")) if path.is_dir() else []
    if found:
        return lambda: found
    if (path / TRIALS).is_file():
        return lambda: [_made(path, lambda target: record_campaign(path, read_campaigns(path)[0], target))]
    if not path.exists():
        raise UsageError(
            f"expected a .rrd file, a {LOG} or a folder with one, found no {path}: name the results of a run"
        )
    log = path if path.name == LOG else path / LOG
    logs = [log] if log.is_file() else sorted(path.glob(f"*/{LOG}"))
    if not logs:
        raise UsageError(f"expected a .rrd file, a {LOG} or a folder with one, found {path}: name the results of a run")
    runs = [read_run(each) for each in logs]
    if not all(is_same_drive(runs[0], run) for run in runs):
        raise UsageError(f"expected one run, found several in {path}: name the folder of one")
    options = read_options(logs[0].with_name("config.json"))
    return lambda: [_made(log.parent if len(logs) == 1 else path, lambda target: _record(runs, options, target))]


def _made(folder: Path, record: Callable[[Path], list[str]]) -> Path:
    """Return a new recording in a folder; raises UsageError if it could not be written."""
    prepare(folder)
    target = folder / RECORDING
    problems = record(target)
    if problems:
        raise UsageError(
            f"expected to write a recording into {folder}, found {problems[0]}: make it writable and try again"
        )
    return target


def _record(runs: list[RecordedRun], options: ReplayOptions, target: Path) -> list[str]:
    """Replay each run's log in the same way, all in one recording; return the problems."""
    run = runs[0]
    trial, backends = run.trial, list(dict.fromkeys(run.trial.backend for run in runs))
    world = load_world(trial.world, trial.start, trial.drawing)
    title = f"{world.name}: {', '.join(backends)}, seed {trial.seed}, from the log, {options.association} association"
    recording = TimelineOutput(title, backends, world, trial.errorless, target)
    for backend in backends:
        if recording.is_on:
            watch = recording.watch(backend, lambda step: run.true_poses_world[step.index])
            replay(run, backend, options, watch)
    return recording.close()
