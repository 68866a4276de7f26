"""Runs the missing trials of a campaign on local cores or on a cluster, with identical results."""

from collections.abc import Callable, Iterable, Iterator, Sequence
from dataclasses import dataclass, replace
from time import monotonic

from rich.progress import MofNCompleteColumn

from ..artifacts.presets import METHODS
from ..terminal.progress import bar_of, duration
from .plan import CLOSED, Trial, config_of, recordings, trials
from .plugins import with_own
from .store import Store
from .work import Done, Job, failed, pack, perform
from .workers import on_workers

Executor = Callable[[Iterable[Job]], Iterator[Done]]
"""Performs jobs in any order and takes each one only when there is room for it."""


@dataclass(frozen=True)
class Tally:
    """The cost of a campaign's trials, without those that were finished before."""

    trials: int
    """Recordings for replays among them."""
    wall_s: float
    cpu_s: float
    """Summed over all processes."""

    def words(self) -> str:
        """Return the rate and the mean number of busy processes: with two processes, 2 is perfect."""
        if not self.trials:
            return "all trials were finished already"
        return (
            f"{self.trials} trials in {duration(self.wall_s)}: {self.trials / self.wall_s:.2f} a second, computing time"
            f" {duration(self.cpu_s)}, {self.cpu_s / self.wall_s:.2f} processes at a time"
        )


def missing(store: Store) -> list[Trial]:
    """Return every trial without a result, and the recordings that its replays need, in the order of performing."""
    drives = [job.trial for job in _drives(store)]
    return drives + _rest(store, drives)


def run_campaign(store: Store, executor: Executor) -> Tally:
    """Perform every trial without a result, recordings first; finished trials are kept whatever happens."""
    began, count, cpu_s = monotonic(), 0, 0.0
    drives = _drives(store)
    rest = _rest(store, [job.trial for job in drives])
    total = len(drives) + len(rest)
    with bar_of("trials", float(total), MofNCompleteColumn()) as (bar, task):
        for jobs in (iter(drives), (_job(store, trial) for trial in rest)):
            for done in executor(jobs):
                store.save(done)
                count, cpu_s = count + 1, cpu_s + done.cpu_s
                bar.advance(task)
    return Tally(count, monotonic() - began, cpu_s)


def _rest(store: Store, driven: Sequence[Trial]) -> list[Trial]:
    """Return the missing trials that are not driven as recordings."""
    done = set(driven)
    rest = [t for t in trials(store.campaign) if not store.has(t) and t not in done]
    # Replays of one recording are consecutive, so that a process reads it only once.
    rest.sort(key=lambda t: (store.campaign.worlds.index(t.world), t.strategy, t.seed))
    return rest


def _drives(store: Store) -> list[Job]:
    """Return the recordings that are missing; a closed loop of the driver serves as one."""
    campaign, jobs = store.campaign, []
    own = campaign.driver in campaign.backends and CLOSED in campaign.arms
    for recording in recordings(campaign):
        trial = recording
        if own:
            trial = Trial(recording.world, recording.strategy, campaign.driver, CLOSED, recording.seed)
        if not store.has(recording) or (own and not store.has(trial)):
            jobs.append(Job(trial, config_of(campaign, recording), keep_log=True))
    return jobs


def _job(store: Store, trial: Trial) -> Job:
    if trial.association is None:
        return Job(trial, config_of(store.campaign, trial))
    recording = trial.recording
    # A method brings its own mapper; plain back ends share one, and with it the recording, which is read once.
    rules = replace(recording, backend=trial.backend) if trial.backend in METHODS else recording
    return Job(trial, config_of(store.campaign, rules), store.path(recording).read_bytes())


def on_cores(count: int | None) -> Executor:
    """Return an executor over `count` local processes, or one for each core."""
    return on_workers(with_own(perform), lost, count)


def lost(job: Job, reason: str) -> Done:
    """Return the record of a trial that returned nothing."""
    return Done(job.trial, pack(failed(job, reason)))
