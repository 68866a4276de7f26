"""`chainslam explore`: one world, one robot, one map."""

from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Annotated

import tyro

from chainslam.explore.following.wall_following import Following, Navigation
from chainslam.explore.step import Step
from chainslam.sim.worlds import AS_DRAWN, DrawingOptions

from ..artifacts.presets import PresetName
from ..artifacts.run_folder import default_folder, point_latest_at
from ..artifacts.settings import (
    DRAWING,
    KEYS,
    drawing_settings,
    parse_setting,
)
from ..library.asked import SETTLED, asked_trial, continued, refuse_settled
from ..library.driving import Finished, Watch, begin, go_on
from ..library.echo import echo_world, expected_steps, run_line
from ..scenario import DRIVER, HAS_GTSAM, P0, OdometrySource, Scenario, TrialConfig, check, load_world
from ..scoring.without_truth.unseen_floor import unseen_words
from ..terminal.answers import found
from ..terminal.console import say, written
from ..terminal.interrupts import first_interrupt_waits
from ..terminal.progress import progress
from ..trial import TrialResult
from ..usage import UsageError
from ..views.run_lines import lines_of, notes_of
from ..views.timelines import TimelineOutput


@dataclass(frozen=True)
class Explore:
    """Explore a world until every chain of walls is closed, and write the map and its scores."""

    world: Annotated[tyro.conf.Positional[str | None], tyro.conf.arg(metavar="WORLD")] = None
    """Name of a bundled world (see `chainslam worlds`), or a file: plan JSON, GeoJSON, SVG, DXF, a picture or a ROS
    map YAML."""
    backend: str = DRIVER
    """Estimator (see `chainslam backends`)."""
    strategy: str = "nearest-robot"
    """Strategy that chooses where to explore next (see `chainslam strategies`); `A,B@200` changes from A to B at
    step 200."""
    seed: int = 1
    """Seed of sensor noise, wheel slip and the error of the initial pose; the same seed gives identical results."""
    p0: P0 = "small"
    """Standard deviations of the initial pose: zero (0.1 mm, 1e-5 rad), small (0.01 m, 0.1 degree) or large (0.1 m,
    2 degrees)."""
    errorless: bool = False
    """Simulate ranges and odometry without noise and start at the true pose; the estimators still assume the stated
    noise."""
    sweep: bool = True
    """After the last chain is closed, visit the floor that no scan has seen; the paper's robot did not."""
    navigation: Navigation = "floor"
    """How paths are planned: over the floor seen free, or along sequences of walls as in the paper."""
    following: Following = "viewpoints"
    """How an open end is explored: from viewpoints around it, or by following its wall back and forth and rounding
    its ends as in the paper."""
    odometry: OdometrySource = "wheels"
    """Source of the motion between two scans: wheel odometry, or scan matching that starts from it."""
    max_steps: int | None = None
    """Stop the run after this many scans; 100,000 by default."""
    max_path: Annotated[float | None, tyro.conf.arg(metavar="METRES")] = None
    """Stop the run once the odometry has counted this many metres."""
    time_limit: Annotated[float | None, tyro.conf.arg(metavar="SECONDS")] = None
    """Stop the run after this many seconds on the robot's own clock. It counts driving and scanning, not computing,
    so that a run stops at the same step on every machine."""
    return_to_start: bool = False
    """Drive back to the start once nothing is left to explore, to within 0.2 m."""
    start: tuple[float, ...] | None = None
    """Start pose in place of the drawing's: x and y in metres, and optionally the heading in rad."""
    fence: Annotated[str | None, tyro.conf.arg(metavar="BOX|FILE")] = None
    """Stay within a box, X0,Y0,X1,Y1 in metres of the world, or within the polygon of a GeoJSON file. What lies
    beyond is not explored, which ends a run outdoors or in an unbounded world."""
    map: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Go on with the map of an earlier run in the same building, of this results folder: the robot begins lost, finds
    its place in that map, and maps what is missing. The results are those of both sessions together."""
    drawing: tyro.conf.OmitArgPrefixes[DrawingOptions] = AS_DRAWN
    """How the world's file is read."""
    out: Path | None = None
    """Folder for the results; by default results/WORLD-BACKEND-STRATEGY-SEED. A folder with anything but the same
    run is refused."""
    force: bool = False
    """Replace another run in the folder for the results: remove the files of a run, and no others."""
    preset: PresetName | None = None
    """A named method: paper-method is everything that the paper describes, with its filter, matching, navigation
    and wall following (docs/concepts/exploration.md). --config, --set and other options have priority."""
    robot: str | None = None
    """Description of the robot and its simulated devices: a bundled robot (paper, turtlebot, front-scanner) or a
    YAML file (docs/howto/use-your-robot.md). --config, --set and other options have priority."""
    config: Path | None = None
    """Settings from a file: a run's `config.json`, or an object with some of its keys. --set and other options have
    priority."""
    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="KEY=VALUE")] = ()
    """One setting by its key in `config.json`, such as `mission.mapper.matching.gate=0.95`; may be repeated."""
    resume: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Instead of WORLD: continue the run in this folder, which was stopped or killed, up to its own limits or those
    given here. It is driven again from its start, takes as long again, and leaves the results of an uninterrupted
    run."""
    rrd: Path | None = None
    """Record the run for Rerun's viewer into this file (`chainslam view FILE` opens it)."""
    view: bool = False
    """Open Rerun's viewer and show the run as it goes on, instead of recording it."""
    given: tyro.conf.Suppress[frozenset[str]] = frozenset()
    """The options that stand in the command, with whatever value."""

    @property
    def trial(self) -> TrialConfig:
        """The settings of the run, without its folder; raises UsageError if no world is given."""
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
            raise UsageError("expected --rrd or --view, found both: leave one out (the viewer can save what it shows)")
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
            reason = driven.result.ending.reason
            told = f"expected to get past the end of the saved run, found {reason}: its files are unchanged,"
            say(f"chainslam: {told} --resume continues it", stderr=True)
            return driven.result.ending.exit_status
        status = _told(driven.result, driven.folder, driven.problems + recordings[0].close())
        if self.out is None and self.resume is None:
            point_latest_at(driven.folder)
        return status

    @contextmanager
    def _watched(self, recordings: list[TimelineOutput], scenario: Scenario) -> Iterator[Watch]:
        """Announce a run, show its progress and record it; the recording is appended to a list."""
        trial, world = scenario.config, scenario.world
        if recordings:  # A later session found its place: both are recorded as one.
            recordings.pop().drop()
        else:
            echo_world(world)
            say(run_line(world, trial))
        if not HAS_GTSAM and trial.backend == DRIVER and not self._is_given("backend"):
            say(f"note: the package gtsam is not installed; {DRIVER} is used instead of graph")
        noise = "errorless" if trial.errorless else f"seed {trial.seed}"
        title = f"{world.name}: {trial.backend}, {trial.strategy}, {noise}"
        recording = TimelineOutput(title, [trial.backend], world, trial.errorless, self.rrd, self.view)
        recordings.append(recording)
        steps = sum(expected_steps(world, trial.max_steps)) / 2
        try:
            with progress(world.name, steps, unseen_words) as show, first_interrupt_waits() as stop_if_asked:

                def watch(step: Step) -> None:
                    show(step)
                    stop_if_asked()

                yield recording.watch(trial.backend, lambda step: scenario.robot.record.poses_world[-1], watch)
        except UsageError:
            recording.drop()
            raise


def _told(result: TrialResult, folder: Path, problems: list[str]) -> int:
    """Print the result of a run, and return the exit status."""
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
