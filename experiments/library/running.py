"""`explore` and `replay` as functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from contextlib import nullcontext
from dataclasses import asdict, replace
from functools import partial
from inspect import signature
from pathlib import Path
from typing import Any, overload

from chainslam.explore.following.wall_following import Following, Navigation
from chainslam.slam.backends import BACKENDS
from chainslam.slam.robot import Robot, RobotSpec

from ..artifacts.presets import PresetName
from ..artifacts.results import REPLAY, config_record, write_results
from ..artifacts.run_folder import held, prepare, refuse_others, settle
from ..artifacts.settings import drawing_said, drawing_settings, settings_of
from ..campaign.plugins import register_installed
from ..replays.measured import check_references, held_against
from ..replays.real_log import RealOptions
from ..replays.replay import Association, ReplayOptions
from ..replays.sources import RECORDED, OwnLog, RealLog
from ..replays.unwitnessed import run_unwitnessed, unwitnessed
from ..scenario import DRIVER, P0, OdometrySource, check, load_world
from ..scoring.without_truth.references import References, read_references
from ..terminal.word_order import file_in
from ..trial import TrialResult, default_mission
from ..usage import OR_OWN, UsageError, choose
from .asked import SETTLED, asked_source, asked_trial, continued, refuse_settled
from .driving import Driven, Finished, Watch, begin, go_on
from .runs import Home, Run


def explore(
    world: str | Path | Robot | None = None,
    *,
    backend: str = DRIVER,
    strategy: str = "nearest-robot",
    seed: int = 1,
    p0: P0 = "small",
    errorless: bool = False,
    navigation: Navigation = "floor",
    following: Following = "viewpoints",
    sweep: bool = True,
    odometry: OdometrySource = "wheels",
    max_steps: int | None = None,
    max_path: float | None = None,
    time_limit: float | None = None,
    return_to_start: bool = False,
    start: tuple[float, ...] | None = None,
    scale: float | None = None,
    layers: Sequence[str] = (),
    ids: Sequence[str] = (),
    without: Sequence[str] = (),
    level: str | None = None,
    threshold: float | None = None,
    negate: bool = False,
    map: str | Path | Run | None = None,
    fence: str | None = None,
    preset: PresetName | None = None,
    robot: str | Path | RobotSpec | None = None,
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    resume: str | Path | Run | None = None,
    out: str | Path | None = None,
    force: bool = False,
    watch: Watch = lambda step: None,
) -> Run:
    """Explore a world, or a building with a robot of your own, and return the run, as `chainslam explore` does.

    `world` is a bundled name, a file or a `Robot`. For a robot of your own the truth is unknown, so that scores which
    need it are None, and its first pose is the origin of the map. `robot` describes it: a bundled name, a YAML file or
    a `RobotSpec`. `scale` to `negate` are the command's options for drawings, and `preset`, `config` and `settings` its
    `--preset`, `--config` and `--set`; the latter maps keys to values. `watch` is called with each step. Without `out`
    the files are deleted together with the returned object.

    `resume`, in place of a world, is the folder of a run that was stopped or killed. The run continues there, or in
    `out`, up to its own limits or to those given now, and leaves the same files as an uninterrupted run. Raises
    UsageError for bad input.
    """
    register_installed()
    said: dict[str, Any] = {
        "backend": backend, "strategy": strategy, "seed": seed, "p0": p0, "errorless": errorless, "sweep": sweep,
        "navigation": navigation, "following": following, "odometry": odometry, "max_steps": max_steps,
        "max_path": max_path, "time_limit": time_limit, "return_to_start": return_to_start, "start": start,
        "map": map.folder if isinstance(map, Run) else map,
    }  # fmt: skip
    said = {key: value for key, value in said.items() if value is not None and value != DEFAULTS[key]}
    drawing = drawing_said(
        scale=scale, layers=tuple(layers), ids=tuple(ids), without=tuple(without), level=level, threshold=threshold,
        negate=negate,
    )  # fmt: skip
    if resume is not None:
        more = {"world": world, "fence": fence, "preset": preset, "robot": robot, "config": config, "set": settings}
        named = said.keys() | {key.rpartition(".")[2] for key in drawing_settings(drawing)}
        named |= {key for key, value in more.items() if value}
        refuse_settled(key for key in SETTLED if key in named)
        limits = max_steps, max_path, time_limit, return_to_start
        source = resume.folder if isinstance(resume, Run) else Path(resume)
        place = None if out is None else _folder(out)[0]
        going = go_on(source, place, lambda saved: continued(saved, *limits), force, lambda _: nullcontext(watch))
        home = resume._home if isinstance(resume, Run) and out is None else None
        return Run(source, home) if isinstance(going, Finished) else _run(going, home)
    own = None if isinstance(world, str | Path | None) else world
    spec = robot if isinstance(robot, RobotSpec) else None
    named_world = {} if world is None else {"world": str(world) if own is None else type(own).__name__}
    trial = asked_trial(
        named_world | said,
        drawing_settings(drawing),
        fence,
        preset,
        None if robot is None or spec is not None else str(robot),
        None if config is None else Path(config),
        [settings_of(settings or {})],
    )
    if spec is not None:
        trial = replace(trial, robot=trial.robot.stating(spec))
    check(trial)
    if own is None:
        drawn = load_world(trial.world, trial.start, trial.drawing)
        folder, home = _folder(out)
        return _run(begin(trial, drawn, folder, force, lambda _: nullcontext(watch)), home)
    scenario = unwitnessed(replace(trial, p0="zero"), own)
    record = config_record(scenario.config) | {REPLAY: {RECORDED: asdict(RealOptions())}}
    return _kept(*_folder(out), record, force, lambda: run_unwitnessed(scenario, watch, default_mission))


DEFAULTS = {name: each.default for name, each in signature(explore).parameters.items()}
"""Options with their default value count as not given, so that a preset or a file of settings may decide them."""


@overload
def replay(
    log: str | Path | Run,
    *,
    backend: str | None = None,
    association: Association = "own",
    odometry: OdometrySource | None = None,
    second_looks: bool = False,
    relations: str | Path | None = None,
    reference: str | Path | None = None,
    robot: str | Path | None = None,
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    watch: Watch = ...,
) -> Run: ...


@overload
def replay(
    log: str | Path | Run,
    *,
    backend: list[str] | tuple[str, ...],
    association: Association = "own",
    odometry: OdometrySource | None = None,
    second_looks: bool = False,
    relations: str | Path | None = None,
    reference: str | Path | None = None,
    robot: str | Path | None = None,
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    watch: Watch = ...,
) -> dict[str, Run]: ...


def replay(
    log: str | Path | Run,
    *,
    backend: str | list[str] | tuple[str, ...] | None = None,
    association: Association = "own",
    odometry: OdometrySource | None = None,
    second_looks: bool = False,
    relations: str | Path | None = None,
    reference: str | Path | None = None,
    robot: str | Path | None = None,
    config: str | Path | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    watch: Watch = lambda step: None,
) -> Run | dict[str, Run]:
    """Map a log, or replay that of a run through one back end or several, as `chainslam replay` does.

    Without a back end, a real robot's log is mapped by scan matching and offline refinement, and a run's by `full-ekf`.
    Returns the run, or for a list of names the runs by name. `relations` and `reference` are files with measurements,
    and `second_looks` refines a real robot's log offline after each back end, too. Raises UsageError for bad input.
    """
    register_installed()
    names = () if backend is None else (backend,) if isinstance(backend, str) else tuple(backend)
    path = file_in(log.folder if isinstance(log, Run) else Path(log), "log.npz")
    for name in names:
        choose("back end", name, BACKENDS, OR_OWN)
    references = read_references(*(None if each is None else Path(each) for each in (relations, reference)))
    source = asked_source(
        path,
        ReplayOptions(association, odometry=odometry),
        RealOptions(odometry=odometry, second_looks=second_looks),
        None if robot is None else str(robot),
        None if config is None else Path(config),
        settings_of(settings or {}),
    )
    check_references(references, *source.odometry)
    names = (source.backend,) if backend is None else names
    runs: dict[str, Run] = {}
    folder, home = _folder(out)
    for name in names:
        own = folder / name if len(names) > 1 else folder
        said = source.config(name)
        runs[name] = _kept(own, home, said, force, partial(_replayed, source, name, watch, references))
    return runs if isinstance(backend, list | tuple) else runs[names[0]]


def _replayed(source: OwnLog | RealLog, name: str, watch: Watch, references: References) -> TrialResult:
    return held_against(source.go(name, watch), references)


def _folder(out: str | Path | None) -> tuple[Path, Home | None]:
    """Return the folder for the results, and the owner of a temporary one."""
    if out == "":
        raise UsageError("expected a folder for out, found an empty name: leave it out, or name one")
    if out is not None:
        return Path(out).expanduser(), None
    home = Home()
    return home.folder / "run", home


def _run(driven: Driven, home: Home | None) -> Run:
    """Return the driven run; raises UsageError if it ended before the saved one, or was not written."""
    if driven.fell_short:
        raise UsageError(
            f"expected to pass the end of the saved run, found {driven.result.ending.reason}: its files are left as"
            " they were, resume it again"
        )
    return _written(driven.folder, home, driven.problems)


def _kept(folder: Path, home: Home | None, config: dict[str, Any], force: bool, go: Callable[[], TrialResult]) -> Run:
    """Run in a folder, write all results, and return the run; raises UsageError if something was not written."""
    prepare(folder)
    with held(folder):
        refuse_others(folder, config, force)
        settle(folder, config)
        return _written(folder, home, write_results(go(), folder, config))


def _written(folder: Path, home: Home | None, problems: list[str]) -> Run:
    if problems:
        raise UsageError(f"expected to write a run's files, found {problems[0]}: see {folder}")
    return Run(folder, home)
