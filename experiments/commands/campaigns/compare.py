"""`chainslam compare`: a campaign of many trials and its comparison."""

import os
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from chainslam.explore.following.wall_following import Following, Navigation
from chainslam.sim.worlds import AS_DRAWN, DrawingOptions

from ...artifacts.settings import drawing_settings, parse_settings
from ...campaign.cluster import ClusterError, on_dask
from ...campaign.comparison.tables import write_tables
from ...campaign.contrast import contrast, read_contrast
from ...campaign.merge import merge
from ...campaign.pages.contrast_page import lines_of_contrast
from ...campaign.pages.film import record_campaign
from ...campaign.pages.lines import deciding_arm, lines_of
from ...campaign.plan import (
    RECORDING,
    Campaign,
    check_campaign,
    check_parts,
    drawing_of,
    trials,
)
from ...campaign.runner import missing, on_cores, run_campaign
from ...campaign.store import opened
from ...library.asked import CampaignName, asked_campaign
from ...library.echo import campaign_line, echo_world
from ...replays.paths.external import register
from ...replays.replay import Association
from ...scenario import P0, load_world
from ...terminal.answers import found
from ...terminal.console import say, written
from ...terminal.interrupts import INTERRUPTED
from ...usage import UsageError

FAILED = 1
JOBS_A_CORE = 8
"""More processes per core than this only compete for memory."""


@dataclass(frozen=True)
class Compare:
    """Run many trials of worlds x back ends x strategies, closed loop and replayed, and compare them statistically.

    The same command continues a campaign that was stopped.
    """

    out: Path
    """Folder for the results."""
    preset: CampaignName | None = None
    """A named campaign; other options have priority. paper-method compares the paper's method with today's mapper
    and three back ends."""
    worlds: tuple[str, ...] | None = None
    """Bundled names or files."""
    backends: tuple[str, ...] | None = None
    """Estimators (see `chainslam backends`); `paper-method` among them is the paper's filter and matching."""
    strategies: tuple[str, ...] | None = None
    """Exploration strategies (see `chainslam strategies`)."""
    trials: int | None = None
    """Number of trials of each combination, with consecutive seeds."""
    first_seed: int = 1
    """Seed of the first trial."""
    modes: tuple[Literal["closed", "replay"], ...] = ("closed", "replay")
    """Closed loop, or one recording for each world, strategy and seed that is replayed through all back ends."""
    association: tuple[Association, ...] = ("own", "true")
    """Data association of the replays: the back end's own, the true one, or each in turn."""
    external: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="NAME=COMMAND")] = ()
    """An estimator of your own that is a program: it reads scans and odometry of the recorded drives and writes poses
    (docs/howto/external.md); may be repeated."""
    driver: str = "full-ekf"
    """Back end that drives the recordings."""
    p0: P0 = "small"
    """Standard deviations of the initial pose."""
    errorless: bool = False
    """Simulate without noise; all trials of a combination are then the same, and there is no NEES."""
    max_steps: int | None = None
    """A trial is stopped, and counts as a failure, after this many scans; by default 5000, in preset paper 2500, in
    paper-method 1000."""
    navigation: Navigation = "floor"
    """How paths are planned: over the floor seen free, or along sequences of walls, as in the presets paper and
    paper-method."""
    following: Following = "viewpoints"
    """How an open end is explored: from viewpoints, or by following its wall back and forth, as in preset
    paper-method."""
    drawing: tyro.conf.OmitArgPrefixes[DrawingOptions] = AS_DRAWN
    """How the files of the worlds are read."""
    robot: str | None = None
    """Description of the robot of every trial: a bundled one (paper, turtlebot, front-scanner) or a YAML file
    (docs/howto/use-your-robot.md). --config and --set have priority."""
    config: Path | None = None
    """Settings of every trial from a file: a run's `config.json`, or some of its keys. What the campaign decides
    (worlds and starts, back ends, strategies, seeds) is not taken from it."""
    set: Annotated[tyro.conf.UseAppendAction[tuple[str, ...]], tyro.conf.arg(metavar="KEY=VALUE")] = ()
    """One setting of every trial by its key in `config.json`, with priority over --config; may be repeated."""
    jobs: int | None = None
    """Number of processes; all cores by default. It does not change the results."""
    dask: str | None = None
    """Address of a Dask scheduler whose workers run the trials, instead of `--jobs`."""
    merge: tuple[Path, ...] = ()
    """Combine the campaigns in these folders into one, instead of running any."""
    against: tuple[Path, Path] | None = None
    """Compare two campaigns trial by trial, instead of running any."""

    rrd: Path | None = None
    """Record the summary, and the first log through all back ends side by side, for Rerun's viewer into this
    file."""
    given: tyro.conf.Suppress[frozenset[str]] = frozenset()
    """The options that stand in the command, with whatever value."""

    @property
    def campaign(self) -> Campaign:
        """The campaign of the options; raises UsageError if something is missing."""
        cells = ("worlds", "backends", "strategies", "trials")
        said = ("navigation", "following", "errorless", "p0", "max_steps")
        return asked_campaign(
            {name: getattr(self, name) for name in cells},
            {name: getattr(self, name) for name in said if self._is_given(name)},
            drawing_settings(self.drawing, self.given),
            self.preset,
            self.robot,
            self.config,
            parse_settings(self.set),
            modes=self.modes,
            association=self.association,
            driver=self.driver,
            first_seed=self.first_seed,
            external=register(self.external, is_here=self.dask is None),
        )

    def _is_given(self, name: str) -> bool:
        return name in self.given or getattr(self, name) != getattr(Compare, name)

    def run(self) -> int:
        """Run the command and return its exit status; raises UsageError before anything is computed."""
        if self.merge or self.against:
            return self._of_others()
        campaign = self.campaign
        check_campaign(campaign)
        check_parts(campaign)
        most = JOBS_A_CORE * len(os.sched_getaffinity(0))
        if self.jobs is not None and not 1 <= self.jobs <= most:
            raise UsageError(
                f"expected 1 to {most} processes on this machine, found --jobs {self.jobs}: choose another"
            )
        worlds = [load_world(world, drawing=drawing_of(campaign)) for world in campaign.worlds]
        executor = on_cores(self.jobs) if self.dask is None else on_dask(self.dask)
        with opened(self.out, campaign) as store:
            # Report a result that cannot be read now, not after hours of computing.
            for trial in filter(store.has, trials(campaign)):
                store.record(trial)
            try:
                for world in worlds:
                    echo_world(world)
                jobs = None if self.dask else self.jobs or len(os.sched_getaffinity(0))
                by_name = dict(zip(campaign.worlds, worlds, strict=True))
                left = missing(store)
                if left:
                    runs = [(by_name[trial.world], trial.backend or campaign.driver) for trial in left]
                    recorded = sum(trial.arm == RECORDING for trial in left)
                    say(campaign_line(runs, recorded, campaign.max_steps, jobs))
                tally = run_campaign(store, executor)
            except KeyboardInterrupt:
                print(f"chainslam: interrupted; finished trials are kept in {self.out}, and the same command continues",
                      file=sys.stderr)  # fmt: skip
                return INTERRUPTED
            except ClusterError as error:
                print(f"chainslam: {error}; finished trials are kept in {self.out}, and the same command continues",
                      file=sys.stderr)  # fmt: skip
                return FAILED
            said = write_tables(self.out, campaign, trials(campaign), store.record)
        lines = lines_of(campaign, said)
        pooled = [row for row in said["pooled"] if row["arm"] == deciding_arm(campaign)]
        found(pooled=pooled, verdict=list(lines), folder=str(self.out))
        ends = ", ".join(f"{said['counts'][end]} {end}" for end in ("complete", "stopped", "failed"))
        for words in (f"{tally.words()} ({ends})", *lines, written(self.out)):
            say(words)
        problems = [] if self.rrd is None else record_campaign(self.out, campaign, self.rrd)
        for problem in problems:
            say(f"chainslam: not written: {problem}", stderr=True)
        return 1 if problems else 0

    def _of_others(self) -> int:
        """Merge campaigns or compare two of them; raises UsageError."""
        if self.rrd is not None:
            word = "--merge" if self.merge else "--against"
            raise UsageError(f"expected --rrd with a campaign that runs, found {word}: leave one of them out")
        if self.merge and self.against:
            raise UsageError("expected either --merge or --against, found both: leave one of them out")
        if self.against is None:
            merge(self.merge, self.out)
        else:
            contrast(*self.against, self.out)
            told = lines_of_contrast(read_contrast(self.out))
            found(verdict=list(told))
            for words in told:
                print(words)
        found(folder=str(self.out))
        say(written(self.out))
        return 0
