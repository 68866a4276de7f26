"""`chainslam explore`: one world, one robot, one map."""

import os
import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated

import tyro

from explore.explorer import ExplorerConfig
from explore.mission import MissionConfig
from explore.step import Step

from .console import say
from .echo import echo_world
from .interrupts import first_interrupt_waits
from .progress import print_summary, progress
from .results import write_results
from .saved import read_saved
from .scenario import P0, TrialConfig, UsageError, build, check, load_world
from .timelines import Recording
from .trial import default_mission, run_scenario

SETTLED = ("world", "backend", "strategy", "seed", "p0", "errorless", "sweep", "start", "scale")
"""What a saved run has settled; only its limits may be others when it goes on."""


@dataclass(frozen=True)
class Explore:
    """Explore a world until every chain of walls is closed, and write the map beside how good it is."""

    world: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="WORLD")] = None
    """A name (see `chainslam worlds`) or a file: plan JSON, GeoJSON, SVG, a picture, a ROS map YAML."""
    backend: str = "full-ekf"
    """The estimator (see `chainslam backends`)."""
    strategy: str = "nearest-robot"
    """Where to explore next (see `chainslam strategies`); `A,B@200` changes from A to B at step 200."""
    seed: int = 1
    """Decides all noise and the error of the first estimate; the same seed gives the same bytes."""
    p0: P0 = "small"
    """Covariance of the start: zero (0.1 mm, 1e-5 rad), small (0.01 m, 0.1 degree) or large (0.1 m, 2 degrees)."""
    errorless: bool = False
    """Exact ranges and wheels, the estimate started at the truth; the models keep the stated noise."""
    sweep: bool = True
    """After the last chain is closed, look at the floor that was not seen yet; the paper's robot did not."""
    max_steps: int = 100_000
    """The run is stopped after this many scans."""
    max_path: Annotated[float | None, tyro.conf.arg(metavar="METRES")] = None
    """The run is stopped once the wheels have counted this many metres."""
    time_limit: Annotated[float | None, tyro.conf.arg(metavar="SECONDS")] = None
    """The run is stopped once this many seconds have passed on the robot's own clock: it counts driving and
    scanning, not computing, so that every machine stops at the same step."""
    return_to_start: bool = False
    """Once there is nothing left to explore, drive back to the start, to within 0.2 m."""
    start: tuple[float, ...] | None = None
    """Start pose instead of the drawing's own: x and y in metres, and perhaps the heading in rad."""
    scale: float | None = None
    """Metres per pixel or drawing unit, for files that do not say."""
    out: Path | None = None
    """Folder for the results; by default results/WORLD-BACKEND-STRATEGY-SEED."""
    resume: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """In place of WORLD: go on with the run in this folder, up to the limits given now. It is driven again from its
    start, which takes as long as it took, and leaves what a run that was never stopped would have left."""
    rrd: Path | None = None
    """Record the run for Rerun's viewer into this file (`chainslam view FILE` opens it)."""
    view: bool = False
    """Open Rerun's viewer and show the run as it goes on, instead of recording it."""

    @property
    def trial(self) -> TrialConfig:
        """What decides the run, without where its results go; raises UsageError where no world is named."""
        if self.world is None:
            raise UsageError("expected a WORLD or --resume DIR, found neither: name one")
        return TrialConfig(
            world=self.world,
            backend=self.backend,
            strategy=self.strategy,
            seed=self.seed,
            p0=self.p0,
            errorless=self.errorless,
            max_steps=self.max_steps,
            start=self.start,
            scale=self.scale,
            max_path_m=self.max_path,
            time_limit_s=self.time_limit,
            mission=MissionConfig(explorer=ExplorerConfig(sweep=self.sweep), return_to_start=self.return_to_start),
        )

    def continued(self, saved: TrialConfig) -> TrialConfig:
        """Return a saved run with the limits given now; raises UsageError where anything else is given, too."""
        for name in SETTLED:
            if getattr(self, name) != getattr(Explore, name):
                raise UsageError(
                    f"expected nothing but limits and --out with --resume, found {name}: the saved run has settled it"
                )
        home = self.return_to_start or saved.mission.return_to_start
        return replace(
            saved,
            max_steps=self.max_steps,
            max_path_m=self.max_path,
            time_limit_s=self.time_limit,
            mission=replace(saved.mission, return_to_start=home),
        )

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        saved = None if self.resume is None else read_saved(self.resume)
        trial = self.trial if saved is None else self.continued(saved.trial)
        check(trial)
        if self.view and self.rrd is not None:
            raise UsageError("expected --rrd or --view, found both: the viewer can save what it shows")
        world = load_world(trial.world, trial.start, trial.scale)
        folder = self.out or self.resume or default_folder(world.name, trial)
        prepare(folder)
        scenario = build(trial, world)
        echo_world(world)
        noise = "errorless" if trial.errorless else f"seed {trial.seed}"
        title = f"{world.name}: {trial.backend}, {trial.strategy}, {noise}"
        recording = Recording(title, [trial.backend], world, trial.errorless, self.rrd, self.view)
        with progress(f"exploring {world.name}") as show, first_interrupt_waits() as stop_if_asked:

            def watch(step: Step) -> None:
                if saved is not None:
                    saved.check(step)
                show(step)
                stop_if_asked()

            recorded = recording.watch(trial.backend, lambda step: scenario.robot.record.poses_world[-1], watch)
            result = run_scenario(scenario, recorded, default_mission)
        if saved is not None and len(result.log or ()) < len(saved.recording):
            told = f"expected to pass the end of the saved run, found {result.ending.reason}: its files are left as"
            print(f"chainslam: {told} they were", file=sys.stderr)
            recording.drop()
            return result.ending.exit_status or 2
        problems = write_results(result, folder) + recording.close()
        if self.out is None and saved is None:
            _point_latest_at(folder)
        print_summary(result.summary)
        say(f"results in {folder}")
        if result.ending.exit_status:
            say(f"chainslam: {result.ending.status}: {result.ending.reason}", stderr=True)
        for problem in problems:
            say(f"chainslam: not written: {problem}", stderr=True)
        return result.ending.exit_status or (1 if problems else 0)


def default_folder(world: str, trial: TrialConfig) -> Path:
    """Return the folder for a run that names none: the same run comes to the same place."""
    parts = [world.replace(":", "-"), trial.backend, trial.strategy, str(trial.seed)]
    parts += [trial.p0] if trial.p0 != "small" else []
    parts += ["errorless"] if trial.errorless else []
    return Path("results") / "-".join(parts)


def prepare(folder: Path) -> None:
    """Make a folder that files can be written into; raises UsageError, before anything is computed, where it cannot."""
    try:
        folder.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise UsageError(
            f"expected a folder for the results, found {folder} ({error.strerror}): name another with --out"
        ) from error
    if not os.access(folder, os.W_OK | os.X_OK):
        raise UsageError(f"expected a folder to write into, found {folder} read-only: name another with --out")


def _point_latest_at(folder: Path) -> None:
    """Let results/latest lead to the newest run; file systems without links go without."""
    link = folder.parent / "latest"
    try:
        if link.is_symlink():
            link.unlink()
        link.symlink_to(folder.name, target_is_directory=True)
    except OSError:
        return
