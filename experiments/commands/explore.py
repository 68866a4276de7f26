"""`chainslam explore`: one world, one robot, one map."""

from dataclasses import dataclass, replace
from pathlib import Path
from typing import Annotated, Any

import tyro

from chainslam.explore.following.wall_following import Following
from chainslam.explore.planning.navigators import Navigation
from chainslam.explore.step import Step
from chainslam.sim.worlds import AS_DRAWN, DrawingOptions, World

from ..artifacts.presets import PresetName
from ..artifacts.results import config_record, write_results
from ..artifacts.run_folder import (
    clear_leftovers,
    default_folder,
    held,
    point_latest_at,
    prepare,
    refuse_others,
    settle,
)
from ..artifacts.running_log import RunningLog
from ..artifacts.saved import SavedRun, read_saved
from ..artifacts.settings import (
    DRAWING,
    KEYS,
    drawing_settings,
    parse_setting,
)
from ..library.asked import asked_trial
from ..scenario import DRIVER, HAS_GTSAM, P0, OdometrySource, TrialConfig, build, check, load_world
from ..terminal.answers import found
from ..terminal.console import say, written
from ..terminal.interrupts import first_interrupt_waits
from ..terminal.progress import progress
from ..trial import TrialResult, default_mission, run_scenario
from ..usage import UsageError
from ..views.run_lines import lines_of, notes_of
from ..views.timelines import TimelineOutput
from .echo import echo_world, expected_steps, run_line

MAX_STEPS = TrialConfig.max_steps
SETTLED = (
    "world",
    "backend",
    "strategy",
    "seed",
    "p0",
    "errorless",
    "sweep",
    "navigation",
    "following",
    "odometry",
    "start",
    *DRAWING,
    "fence",
    "preset",
    "robot",
    "config",
    "set",
)
"""What a saved run has settled; only its limits may be others when it goes on."""


@dataclass(frozen=True)
class Explore:
    """Explore a world until every chain of walls is closed, and write the map beside how good it is."""

    world: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="WORLD")] = None
    """A name (see `chainslam worlds`) or a file: plan JSON, GeoJSON, SVG, a picture, a ROS map YAML."""
    backend: str = DRIVER
    """The estimator (see `chainslam backends`)."""
    strategy: str = "nearest-robot"
    """Where to explore next (see `chainslam strategies`); `A,B@200` changes from A to B at step 200."""
    seed: int = 1
    """Decides, in this world, all noise and the error of the first estimate; the same seed gives the same bytes."""
    p0: P0 = "small"
    """Covariance of the start: zero (0.1 mm, 1e-5 rad), small (0.01 m, 0.1 degree) or large (0.1 m, 2 degrees)."""
    errorless: bool = False
    """Exact ranges and wheels, the estimate started at the truth; the models keep the stated noise."""
    sweep: bool = True
    """After the last chain is closed, look at the floor that was not seen yet; the paper's robot did not."""
    navigation: Navigation = "floor"
    """How the robot finds its way: over the floor seen free, or by sequences of walls, as the paper's did."""
    following: Following = "viewpoints"
    """How the robot explores an open end: from viewpoints around it, or as the paper's did, by following its wall to
    and fro and driving round its ends."""
    odometry: OdometrySource = "wheels"
    """Who tells the motion between two scans: the wheels, or the scans themselves, laid onto those before (*scan
    matching*), with the wheels for a first guess."""
    max_steps: int | None = None
    """The run is stopped after this many scans; 100,000 where no number is named."""
    max_path: Annotated[float | None, tyro.conf.arg(metavar="METRES")] = None
    """The run is stopped once the wheels have counted this many metres."""
    time_limit: Annotated[float | None, tyro.conf.arg(metavar="SECONDS")] = None
    """The run is stopped once this many seconds have passed on the robot's own clock: it counts driving and
    scanning, not computing, so that every machine stops at the same step."""
    return_to_start: bool = False
    """Once there is nothing left to explore, drive back to the start, to within 0.2 m."""
    start: tuple[float, ...] | None = None
    """Start pose instead of the drawing's own: x and y in metres, and perhaps the heading in rad."""
    fence: Annotated[str | None, tyro.conf.arg(metavar="BOX|FILE")] = None
    """Stay within a box, X0,Y0,X1,Y1 in metres of the world, or within the polygon of a GeoJSON file. What lies beyond
    is not explored: an outdoor or unbounded world ends there."""
    drawing: tyro.conf.OmitArgPrefixes[DrawingOptions] = AS_DRAWN
    """What the world's file leaves open."""
    out: Path | None = None
    """Folder for the results; by default results/WORLD-BACKEND-STRATEGY-SEED. One that holds anything but the same run
    is refused."""
    force: bool = False
    """Replace another run in the folder for the results: remove the files that a run writes, and no others."""
    preset: PresetName | None = None
    """A method by name: paper-method is all that the paper describes, its filter, its matching, its navigation
    and its wall following
    (docs/exploration.md). --config, --set and options go before it."""
    robot: str | None = None
    """What the robot states of itself, and its devices: a bundled robot (paper, turtlebot, front-scanner) or a YAML
    file (docs/robots.md). --config, --set and options go before it."""
    config: Path | None = None
    """Settings from this file: a run's `config.json`, or an object of some of its keys. An option that is given goes
    before it, and so does --set."""
    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="KEY=VALUE")] = ()
    """One setting by its key in `config.json`, as `mission.mapper.matching.gate=0.95`; may be given again."""
    resume: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """In place of WORLD: go on with the run in this folder, stopped or killed, up to its own limits or to those given
    now. It is driven again from its start, which takes as long as it took, and leaves what a run that was never
    stopped would have left."""
    rrd: Path | None = None
    """Record the run for Rerun's viewer into this file (`chainslam view FILE` opens it)."""
    view: bool = False
    """Open Rerun's viewer and show the run as it goes on, instead of recording it."""
    given: tyro.conf.Suppress[frozenset[str]] = frozenset()
    """The options that stand in the command, with whatever value."""

    @property
    def trial(self) -> TrialConfig:
        """What decides the run, without where its results go; raises UsageError where no world is named."""
        return asked_trial(
            {name: getattr(self, name) for name in KEYS if self._is_given(name)},
            drawing_settings(self.drawing, self.given),
            self.fence,
            self.preset,
            self.robot,
            self.config,
            map(parse_setting, self.set),
        )

    def _is_given(self, name: str) -> bool:
        said, default = (self.drawing, AS_DRAWN) if name in DRAWING else (self, Explore)
        return name in self.given or getattr(said, name) != getattr(default, name)

    def continued(self, saved: TrialConfig) -> TrialConfig:
        """Return a saved run with the limits given now; raises UsageError where anything else is given, too."""
        for name in SETTLED:
            if self._is_given(name):
                raise UsageError(
                    f"expected nothing but limits and --out with --resume, found {name}: the saved run has settled it"
                )
        home = self.return_to_start or saved.mission.return_to_start
        going_on = replace(saved, mission=replace(saved.mission, return_to_start=home))
        if self.max_steps is self.max_path is self.time_limit is None:
            return going_on
        steps = MAX_STEPS if self.max_steps is None else self.max_steps
        return replace(going_on, max_steps=steps, max_path_m=self.max_path, time_limit_s=self.time_limit)

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        if self.view and self.rrd is not None:
            raise UsageError("expected --rrd or --view, found both: the viewer can save what it shows")
        if self.resume is not None:
            return self._go_on(self.resume)
        trial = self.trial
        check(trial)
        world = load_world(trial.world, trial.start, trial.drawing)
        folder = self.out or default_folder(world.name, trial, self.preset)
        prepare(folder)
        with held(folder):
            config = config_record(trial)
            refuse_others(folder, config, self.force)
            settle(folder, config)
            status = self._drive(trial, world, folder, config)
        if self.out is None:
            point_latest_at(folder)
        return status

    def _go_on(self, source: Path) -> int:
        """Take up the run in a folder; raises UsageError where there is none, or none that these limits let go on."""
        # Read before any folder is made, and once more when nobody else can write into it.
        check(self.continued(read_saved(source).trial))
        folder = self.out or source
        prepare(folder)
        with held(folder):
            saved = read_saved(source)
            trial = self.continued(saved.trial)
            world = load_world(trial.world, trial.start, trial.drawing)
            in_place = folder.samefile(source)
            if in_place and saved.is_finished(trial):
                print(f"the run in {source} is finished ({_why(saved)}): nothing done")
                return 0
            if saved.outlasts(trial.limits):
                raise UsageError(
                    f"expected limits beyond the {len(saved)} steps of the saved run, found one before their end: its"
                    " files are left as they were, raise it"
                )
            config = config_record(trial)
            if in_place:
                clear_leftovers(folder)
            else:
                refuse_others(folder, config, self.force)
                settle(folder, config)
            return self._drive(trial, world, folder, config, saved)

    def _drive(
        self, trial: TrialConfig, world: World, folder: Path, config: dict[str, Any], saved: SavedRun | None = None
    ) -> int:
        """Drive a run, write it into its folder, and return the exit status; raises UsageError."""
        scenario = build(trial, world)
        echo_world(world)
        say(run_line(world, trial))
        if not HAS_GTSAM and trial.backend == DRIVER and not self._is_given("backend"):
            say(f"note: the package gtsam is not installed, so that {DRIVER} explores in place of graph")
        noise = "errorless" if trial.errorless else f"seed {trial.seed}"
        title = f"{world.name}: {trial.backend}, {trial.strategy}, {noise}"
        log = RunningLog(folder, config, saved.kept if saved is not None else None)
        recording = TimelineOutput(title, [trial.backend], world, trial.errorless, self.rrd, self.view)
        try:
            steps = sum(expected_steps(world, trial.max_steps)) / 2
            with progress(world.name, steps) as show, first_interrupt_waits() as stop_if_asked:

                def watch(step: Step) -> None:
                    if saved is not None:
                        saved.check(step)
                    log.add(step)
                    show(step)
                    stop_if_asked()

                recorded = recording.watch(trial.backend, lambda step: scenario.robot.record.poses_world[-1], watch)
                result = run_scenario(scenario, recorded, default_mission)
            log.check()
        except UsageError:
            recording.drop()
            if saved is not None and saved.kept is None:
                log.remove()
            raise
        finally:
            log.close()
        if saved is not None and result.ending.exit_status and len(result.log or ()) < len(saved):
            recording.drop()
            told = f"expected to pass the end of the saved run, found {result.ending.reason}: its files are left as"
            say(f"chainslam: {told} they were, --resume goes on", stderr=True)
            return result.ending.exit_status
        problems = write_results(result, folder, config)
        if not problems:
            log.remove()
        problems += recording.close()
        return _told(result, folder, problems)


def _told(result: TrialResult, folder: Path, problems: list[str]) -> int:
    """Print what came of a run, and return the exit status."""
    found(summary=result.summary, folder=str(folder))
    for words in notes_of(result.summary):
        say(f"note: {words}")
    for words in (*lines_of([result.summary]), written(folder)):
        say(words)
    if result.ending.exit_status:
        say(f"chainslam: {result.ending.status}: {result.ending.reason}", stderr=True)
    for problem in problems:
        say(f"chainslam: not written: {problem}", stderr=True)
    return result.ending.exit_status or (1 if problems else 0)


def _why(saved: SavedRun) -> str:
    """Return in words why a finished run is over."""
    assert saved.outcome is not None
    words = f"{saved.outcome.status}: {saved.outcome}"
    return words if saved.outcome.status == "complete" else f"{words}; raise the limit to go on"
