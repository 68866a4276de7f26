"""`chainslam replay`: one recording, one or several back ends."""

import sys
from contextlib import ExitStack
from dataclasses import asdict, dataclass, field
from pathlib import Path
from typing import Annotated

import tyro

from explore.step import Step
from sim.worlds import World
from slam.backends import BACKENDS

from ..artifacts.presets import robot_of, stated
from ..artifacts.results import REPLAY, config_record, write_results
from ..artifacts.run_folder import held, prepare, refuse_others, settle
from ..replays.replay import Association, RecordedRun, ReplayOptions, read_run, replay, replayed, retuned
from ..scenario import load_world
from ..terminal.interrupts import INTERRUPTED, first_interrupt_waits
from ..terminal.progress import print_comparison, progress
from ..trial import TrialResult
from ..usage import UsageError, choose
from ..views.timelines import TimelineOutput


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
    robot: str | None = None
    """What the robot states of itself, in place of what the run's says: a bundled robot (paper, turtlebot,
    front-scanner) or a YAML file (docs/robots.md), of which the devices are left aside: the log has settled them."""
    config: Path | None = None
    """Settings of the mission and of the back ends from this file, in place of those of the run: a run's `config.json`,
    or an object of some of its keys. --set goes before it."""
    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="KEY=VALUE")] = ()
    """One of these settings by its key in `config.json`, as `mission.mapper.matching.gate=0.95`; may be given again."""
    out: Path | None = None
    """Folder for the results, one folder for each of several back ends; by default replay-ASSOCIATION beside LOG."""
    force: bool = False
    """Replace another run in the folder for the results: remove the files that a run writes, and no others."""
    rrd: Path | None = None
    """Record all back ends, side by side on one time axis, for Rerun's viewer (`chainslam view FILE` opens it)."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        for name in self.backend:
            choose("back end", name, BACKENDS)
        run = retuned(read_run(self.log), self.config, self.set, stated(robot_of(self.robot)))
        out = self.out or self.log.parent / f"replay-{self.association}"
        folders = {name: out / name if len(self.backend) > 1 else out for name in self.backend}
        trial = run.trial
        world = load_world(trial.world, trial.start, trial.scale)
        options = ReplayOptions(self.association, self.perfect_extraction, self.perfect_odometry)
        with ExitStack() as stack:
            for folder in folders.values():
                prepare(folder)
                stack.enter_context(held(folder))
            configs = {name: config_record(replayed(run, name)) | {REPLAY: asdict(options)} for name in folders}
            for name, folder in folders.items():
                if folder.samefile(self.log.parent):
                    raise UsageError(
                        f"expected another folder than that of the log, found {folder}: name another --out"
                    )
                refuse_others(folder, configs[name], self.force)
            title = f"{world.name}, seed {trial.seed}, replayed with {self.association} association"
            recording = TimelineOutput(title, self.backend, world, trial.errorless, self.rrd)
            summaries, problems, status = [], [], 0
            for name, folder in folders.items():
                result = self._one(run, name, options, world, recording)
                settle(folder, configs[name])
                problems += write_results(result, folder, configs[name])
                summaries.append(result.summary)
                status = max(status, result.ending.exit_status)
                if status == INTERRUPTED:
                    break
            problems += recording.close()
        print_comparison(summaries, f"{trial.world}, seed {trial.seed}, {self.association} association")
        print(f"results in {out}")
        for problem in problems:
            print(f"chainslam: not written: {problem}", file=sys.stderr)
        return status or (1 if problems else 0)

    def _one(
        self, run: RecordedRun, name: str, options: ReplayOptions, world: World, recording: TimelineOutput
    ) -> TrialResult:
        """Replay through one back end, and stop between two steps where that is asked for."""
        with (
            progress(f"replaying with {name}", float(len(run.recording))) as show,
            first_interrupt_waits() as stop_if_asked,
        ):

            def watch(step: Step) -> None:
                show(step)
                stop_if_asked()

            recorded = recording.watch(name, lambda step: run.true_poses_world[step.index], watch)
            return replay(run, name, options, recorded, world)
