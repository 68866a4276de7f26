"""Drives a run into its folder, from its start or as the continuation of a stopped run, for command and function."""

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import dataclass, field
from pathlib import Path

from chainslam.explore.step import Step
from chainslam.sim.worlds import World

from ..artifacts.results import config_record, write_results
from ..artifacts.run_folder import clear_leftovers, held, prepare, refuse_others, settle
from ..artifacts.running_log import RunningLog
from ..artifacts.saved import SavedRun, read_saved
from ..scenario import Scenario, TrialConfig, build, check, load_world
from ..trial import TrialResult, default_mission, run_scenario
from ..usage import UsageError
from .earlier import scored
from .sessions import begin_later, together

Watch = Callable[[Step], None]
Watching = Callable[[Scenario], AbstractContextManager[Watch]]
"""Context manager around the drive of a scenario; it yields the function that observes each step."""


@dataclass(frozen=True)
class Driven:
    """The result of a drive."""

    folder: Path
    result: TrialResult
    problems: list[str] = field(default_factory=list)
    """What could not be written, in words."""
    fell_short: bool = False
    """Whether it ended before the end of the saved run, whose files are then unchanged."""


@dataclass(frozen=True)
class Finished:
    """A run that is finished and cannot be continued."""

    folder: Path
    why: str


def begin(trial: TrialConfig, world: World, folder: Path, force: bool, watching: Watching) -> Driven:
    """Drive a run into its folder; raises UsageError if another run is there, unless `force` replaces it."""
    prepare(folder)
    with held(folder):
        _take(folder, trial, force)
        return _drive(trial, world, folder, watching)


def go_on(
    source: Path,
    out: Path | None,
    continued: Callable[[TrialConfig], TrialConfig],
    force: bool,
    watching: Watching,
) -> Driven | Finished:
    """Continue the run in a folder, and write it there or into another one.

    `continued` applies the requested limits to its settings. Raises UsageError if there is no run, or if these limits
    do not let it continue.
    """
    # Read before any folder is made, and again once the folder is locked.
    check(continued(read_saved(source).trial))
    folder = out or source
    prepare(folder)
    with held(folder):
        saved = read_saved(source)
        trial = continued(saved.trial)
        world = load_world(trial.world, trial.start, trial.drawing)
        in_place = folder.samefile(source)
        if in_place and saved.is_finished(trial):
            return Finished(source, _why(saved))
        if saved.outlasts(trial.limits):
            raise UsageError(
                f"expected limits beyond the {len(saved)} steps of the saved run, found one before its end: raise it"
                " (the files are unchanged)"
            )
        if in_place:
            clear_leftovers(folder)
        else:
            _take(folder, trial, force)
        return _drive(trial, world, folder, watching, saved)


def _take(folder: Path, trial: TrialConfig, force: bool) -> None:
    config = config_record(trial)
    refuse_others(folder, config, force)
    settle(folder, config)


def _drive(trial: TrialConfig, world: World, folder: Path, watching: Watching, saved: SavedRun | None = None) -> Driven:
    """Drive a run in a locked folder, with a log that survives if the process is killed, and write its results."""
    scenario, config, begun = build(trial, world), config_record(trial), None
    if trial.map is not None:
        with watching(scenario) as watch:
            begun = begin_later(Path(trial.map), scenario, watch)
        if begun.later is None:
            return Driven(folder, begun.result, write_results(begun.result, folder, config))
        scenario = begun.later
    log = RunningLog(folder, config, saved.kept if saved is not None else None)
    try:
        with watching(scenario) as watch:

            def see(step: Step) -> None:
                if saved is not None:
                    saved.check(step)
                log.add(step)
                watch(step)

            result = run_scenario(scenario, see, default_mission if begun is None else together(begun.recorded))
            log.check()
    except UsageError:
        if saved is not None and saved.kept is None:
            log.remove()
        raise
    finally:
        log.close()
    if begun is not None:
        result.summary["session"] = scored(begun.told, result)
    if saved is not None and result.ending.exit_status and len(result.log or ()) < len(saved):
        return Driven(folder, result, fell_short=True)
    problems = write_results(result, folder, config)
    if not problems:
        log.remove()
    return Driven(folder, result, problems)


def _why(saved: SavedRun) -> str:
    """Return the reason why a run is finished, in words."""
    assert saved.outcome is not None
    words = f"{saved.outcome.status}: {saved.outcome}"
    return words if saved.outcome.status == "complete" else f"{words}; raise the limit to continue"
