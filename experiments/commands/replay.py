"""`chainslam replay`: one recording, one or several back ends."""

import sys
from contextlib import ExitStack
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated

import tyro

from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.slam.backends import BACKENDS

from ..artifacts.results import write_results
from ..artifacts.run_folder import held, prepare, refuse_others, settle
from ..artifacts.settings import parse_settings
from ..library.asked import asked_source
from ..library.earlier import scored
from ..library.later_logs import placed_real
from ..library.sessions import placed_log
from ..replays.measured import check_references, held_against
from ..replays.paths.external import register
from ..replays.real_log import RealOptions
from ..replays.replay import Association, ReplayOptions
from ..replays.sources import OwnLog, RealLog
from ..scenario import OFFLINE, OdometrySource
from ..scoring.without_truth.references import read_references
from ..terminal.answers import found
from ..terminal.console import say, written
from ..terminal.interrupts import INTERRUPTED, first_interrupt_waits
from ..terminal.progress import in_lines, progress, share_of
from ..trial import TrialResult
from ..usage import OR_OWN, UsageError, choose
from ..views.run_lines import lines_of, notes_of
from ..views.timelines import TimelineOutput


@dataclass(frozen=True)
class Replay:
    """Map a log, or replay it through one or several back ends, all with identical scans.

    A real robot's log is mapped by scan matching and offline refinement, unless back ends are named. Its truth is
    unknown, so that only scores without it are written; the log of a run holds it.
    """

    log: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="LOG")]
    """The log.npz of a run, or of your own robot with its config.json beside it; a CARMEN, dp-slam or BreezySLAM
    log, optionally packed with gzip; or a ROS bag (a file, or the folder of a ROS 2 bag)."""
    backend: tuple[str, ...] = ()
    """Estimators to compare (see `chainslam backends`), each with an estimate at each step. By default full-ekf for a
    run's log, and none for a real robot's: offline refinement alone is faster and more accurate."""
    external: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME=COMMAND")] = ()
    """An estimator of your own that is a program: it reads the scans and odometry of the log and writes poses
    (docs/howto/external.md); may be repeated."""
    association: Association = "own"
    """Data association: the back end's own, or the true one."""
    perfect_extraction: bool = False
    """Replace the extracted segments by true lines with noise of exactly the stated covariance."""
    perfect_odometry: bool = False
    """Replace the reported motions by the true ones; the stated covariance stays."""
    odometry: OdometrySource | None = None
    """Source of the motion between two scans: wheel odometry, or scan matching that starts from it. By default as
    when the run was driven, and scan matching for a real robot's log."""
    second_looks: bool = False
    """Refine a real robot's log offline once its drive has ended: associate all segments again and smooth the path
    (trajectory_smoothed.tum). Without --backend, and with back ends that smooth, this is always done."""
    every: int = 1
    """Map every n-th keyframe of a real robot's log (keyframes are scans 0.1 m or 5 degrees apart)."""
    range_noise: float | None = None
    """Standard deviation of a range in a real robot's log, in metres; by default 0.02, since logs do not state it
    and real walls scatter more than scanners do."""
    scan_topic: str | None = None
    """Topic of the scans in a ROS bag with several; by default the one with the widest view."""
    odom_topic: str | None = None
    """Topic of the odometry in a ROS bag with several; by default the first by name."""
    relations: Path | None = None
    """Measured relations between poses, `t1 t2 x y z roll pitch yaw` on each line, with which the path is
    compared."""
    reference: Path | None = None
    """Measured path, in the TUM format or `t x y theta` on each line, with which the path is compared."""
    map: Annotated[Path | None, tyro.conf.arg(metavar="DIR")] = None
    """Go on with the map of an earlier run or log in the same building, of this results folder: the robot's place in
    that map is found from the log, and both are mapped as one."""
    robot: str | None = None
    """Description of the robot in place of the run's: a bundled robot (paper, turtlebot, front-scanner) or a YAML
    file (docs/howto/use-your-robot.md), whose simulated devices are ignored."""
    config: Path | None = None
    """Settings of the mission and the back ends in place of the run's: a run's `config.json`, or an object with
    some of its keys. --set has priority."""
    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="KEY=VALUE")] = ()
    """One of these settings by its key in `config.json`, such as `mission.mapper.matching.gate=0.95`; may be
    repeated."""
    out: Path | None = None
    """Folder for the results, with one folder for each of several back ends; by default replay-ASSOCIATION beside
    LOG, and replay-LOG for a real robot's log."""
    force: bool = False
    """Replace another run in the folder for the results: remove the files of a run, and no others."""
    rrd: Path | None = None
    """Record all back ends side by side on one time axis for Rerun's viewer (`chainslam view FILE` opens it)."""

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        for name in self.backend:
            choose("back end", name, BACKENDS, OR_OWN)
        references = read_references(self.relations, self.reference)
        source, session = self.source(), None
        riders = tuple(name for name, _ in register(self.external))
        names = (*self.backend, *riders) or (source.backend,)
        if self.map is not None:
            if riders:
                raise UsageError("expected --external without --map, found both: leave one of them out")
            if isinstance(source, OwnLog):
                source, session = placed_log(source, self.map, names[0])
            else:
                with share_of("seeking the place in the saved map"):
                    source, session = placed_real(source, self.map)
        check_references(references, *source.odometry)
        out = self.out or self.log.parent / f"replay-{self._kind(source)}"
        folders = {name: out / name if len(names) > 1 else out for name in names}
        with ExitStack() as stack:
            for folder in folders.values():
                prepare(folder)
                stack.enter_context(held(folder))
            configs = {name: source.config(name) for name in folders}
            for name, folder in folders.items():
                if folder.samefile(self.log.parent):
                    raise UsageError(f"expected a folder other than the log's, found {folder}: name another --out")
                refuse_others(folder, configs[name], self.force)
            recording = self._timeline(source, names)
            summaries, problems, status = [], [], 0
            for name, folder in folders.items():
                mapped = self._one(source, name, recording)
                # What was computed is written first, which takes seconds.
                with first_interrupt_waits():
                    result = held_against(mapped, references)
                    if session is not None:
                        result.summary["session"] = scored(session, result)
                    settle(folder, configs[name])
                    problems += write_results(result, folder, configs[name])
                summaries.append(result.summary)
                status = max(status, result.ending.exit_status)
                if status == INTERRUPTED:
                    break
            problems += recording.close()
        found(summaries={summary["backend"]: summary for summary in summaries}, folder=str(out))
        for summary in summaries:
            for words in notes_of(summary):
                say(f"note: {summary['backend']}: {words}")
        ended = {summary["reason"]: summary["outcome"] for summary in summaries}
        for words, outcome in ended.items():
            if outcome == Outcome.FAILED:
                say(f"chainslam: failed: {words}", stderr=True)
        for words in (*lines_of(summaries), written(out)):
            say(words)
        for problem in problems:
            print(f"chainslam: not written: {problem}", file=sys.stderr)
        return status or (1 if problems else 0)

    def source(self) -> OwnLog | RealLog:
        """Read and return the log; raises UsageError for an invalid one."""
        own = ReplayOptions(self.association, self.perfect_extraction, self.perfect_odometry, self.odometry)
        topics = self.scan_topic, self.odom_topic
        real = RealOptions(self.every, self.odometry, self.second_looks, self.range_noise, *topics)
        return asked_source(self.log, own, real, self.robot, self.config, parse_settings(self.set))

    def _kind(self, source: OwnLog | RealLog) -> str:
        return self.association if isinstance(source, OwnLog) else source.title.partition(".")[0]

    def _timeline(self, source: OwnLog | RealLog, names: tuple[str, ...]) -> TimelineOutput:
        if isinstance(source, RealLog):
            return TimelineOutput(source.title, names, None, True, self.rrd)
        return TimelineOutput(source.title, names, source.world, source.run.trial.errorless, self.rrd)

    def _one(self, source: OwnLog | RealLog, name: str, recording: TimelineOutput) -> TrialResult:
        """Replay through one back end; an interrupt ends it between two steps, and what was found so far is kept."""
        title = "matching scans" if name == OFFLINE else f"replaying with {name}"
        in_file = in_lines(title)
        with progress(title, float(source.scans)) as show, first_interrupt_waits() as stop_if_asked:

            def watch(step: Step) -> None:
                show(step)
                in_file((step.index + 1) / source.scans)
                stop_if_asked()

            if isinstance(source, OwnLog):
                return source.go(name, recording.watch(name, source.true_pose, watch))
            mapped = source.mapped(name, recording.watch(name, None, watch, source.wheels_pose))
        with share_of("refining offline") as show_share, first_interrupt_waits() as stop_if_asked:

            def refining(share: float) -> None:
                show_share(share)
                stop_if_asked()

            return source.looked_over(mapped, refining)
