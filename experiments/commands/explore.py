"""`chainslam explore`: one world, one robot, one map."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from chainslam.explore.following.wall_following import Following
from chainslam.explore.planning.navigators import Navigation
from chainslam.explore.step import Step
from chainslam.sim.worlds import AS_DRAWN, DrawingOptions

from ..artifacts.presets import PresetName
from ..artifacts.run_folder import default_folder, point_latest_at
from ..artifacts.settings import (
    DRAWING,
    drawing_settings,
    parse_setting,
)
from ..library.asked import KEYS, SETTLED, asked_trial, continued, refuse_settled
from ..library.driving import Finished, Watch, begin, go_on
from ..scenario import DRIVER, HAS_GTSAM, P0, OdometrySource, Scenario, TrialConfig, check, load_world
from ..terminal.answers import found
from ..terminal.console import say
from ..terminal.interrupts import first_interrupt_waits
from ..terminal.progress import print_summary, progress
from ..trial import TrialResult
from ..usage import UsageError
from ..views.timelines import TimelineOutput
from .echo import echo_world, expected_steps, run_line


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

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        if self.view and self.rrd is not None:
            raise UsageError("expected --rrd or --view, found both: the viewer can save what it shows")
        recordings: list[TimelineOutput] = []
        watching = partial(self._watched, recordings)
        if self.resume is not None:
            refuse_settled(filter(self._is_given, SETTLED))
            limits = self.max_steps, self.max_path, self.time_limit, self.return_to_start
            driven = go_on(self.resume, self.out, lambda saved: continued(saved, *limits), self.force, watching)
            if isinstance(driven, Finished):
                print(f"the run in {driven.folder} is finished ({driven.why}): nothing done")
                return 0
        else:
            trial = self.trial
            check(trial)
            world = load_world(trial.world, trial.start, trial.drawing)
            driven = begin(
                trial, world, self.out or default_folder(world.name, trial, self.preset), self.force, watching
            )
        if driven.fell_short:
            recordings[0].drop()
            told = f"expected to pass the end of the saved run, found {driven.result.ending.reason}: its files are left"
            say(f"chainslam: {told} as they were, --resume goes on", stderr=True)
            return driven.result.ending.exit_status
        status = _told(driven.result, driven.folder, driven.problems + recordings[0].close())
        if self.out is None and self.resume is None:
            point_latest_at(driven.folder)
        return status

    @contextmanager
    def _watched(self, recordings: list[TimelineOutput], scenario: Scenario) -> Iterator[Watch]:
        """Tell of a run that begins, and show and record its steps; the recording is added to a list."""
        trial, world = scenario.config, scenario.world
        echo_world(world)
        say(run_line(world, trial))
        if not HAS_GTSAM and trial.backend == DRIVER and not self._is_given("backend"):
            say(f"note: the package gtsam is not installed, so that {DRIVER} explores in place of graph")
        noise = "errorless" if trial.errorless else f"seed {trial.seed}"
        title = f"{world.name}: {trial.backend}, {trial.strategy}, {noise}"
        recording = TimelineOutput(title, [trial.backend], world, trial.errorless, self.rrd, self.view)
        recordings.append(recording)
        steps = sum(expected_steps(world, trial.max_steps)) / 2
        try:
            with progress(world.name, steps) as show, first_interrupt_waits() as stop_if_asked:

                def watch(step: Step) -> None:
                    show(step)
                    stop_if_asked()

                yield recording.watch(trial.backend, lambda step: scenario.robot.record.poses_world[-1], watch)
        except UsageError:
            recording.drop()
            raise


def _told(result: TrialResult, folder: Path, problems: list[str]) -> int:
    """Print what came of a run, and return the exit status."""
    print_summary(result.summary)
    found(folder=str(folder))
    say(f"results in {folder}")
    if result.ending.exit_status:
        say(f"chainslam: {result.ending.status}: {result.ending.reason}", stderr=True)
    for problem in problems:
        say(f"chainslam: not written: {problem}", stderr=True)
    return result.ending.exit_status or (1 if problems else 0)
