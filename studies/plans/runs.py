"""Explored plans, kept in folders: what was explored once is measured again without being driven again."""

from collections.abc import Callable, Sequence
from functools import partial
from pathlib import Path

from chainslam.experiments.artifacts.results import write_results
from chainslam.experiments.campaign.workers import on_workers
from chainslam.experiments.scenario import TrialConfig, load_world
from chainslam.experiments.trial import run_trial
from chainslam.experiments.usage import UsageError
from chainslam.sim.worlds import World


def plans_in(folder: Path, named: str, most: int) -> list[Path]:
    """Return the first plans of a folder; raises UsageError without any."""
    found = sorted(path for path in folder.glob(named) if path.is_file())[:most]
    if not found:
        raise UsageError(f"expected plans, found no file {named} in {folder}: check it")
    return found


def as_drawn(world: World) -> World:
    """Return the building of a drawing, built as it is drawn."""
    return world


def explored(
    plans: Sequence[Path], backend: str, seed: int, home: Path, jobs: int, built: Callable[[World], World]
) -> list[Path]:
    """Return a folder of results for each plan; those that are not there yet are explored, as they were `built`."""
    folders = [home / f"{plan.stem}-{backend}-{seed}" for plan in plans]
    tasks = [(plan, folder) for plan, folder in zip(plans, folders, strict=True) if not (folder / "map.npz").exists()]
    one = partial(_explore, backend, seed, built)
    for _ in map(one, tasks) if jobs <= 1 else on_workers(one, _lost, jobs)(tasks):
        pass
    return [folder for folder in folders if (folder / "map.npz").exists()]


def _explore(backend: str, seed: int, built: Callable[[World], World], task: tuple[Path, Path]) -> None:
    plan, folder = task
    result = run_trial(TrialConfig(str(plan), backend, seed=seed), world=built(load_world(str(plan))))
    folder.mkdir(parents=True, exist_ok=True)
    write_results(result, folder)


def _lost(task: tuple[Path, Path], reason: str) -> None:
    raise RuntimeError(f"expected a run of {task[0].name}, found none: {reason}")
