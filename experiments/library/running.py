"""`explore` and `replay` as functions."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any, overload

from chainslam.explore.following.wall_following import Following
from chainslam.explore.planning.navigators import Navigation
from chainslam.explore.step import Step
from chainslam.slam.backends import BACKENDS
from chainslam.slam.robot import Robot, RobotSpec

from ..artifacts.results import REPLAY, config_record, write_results
from ..artifacts.run_folder import held, prepare, refuse_others, settle
from ..artifacts.settings import drawing_said, options_of
from ..campaign.plugins import register_installed
from ..commands.explore import Explore
from ..commands.replay import Replay
from ..replays.real_log import RealOptions
from ..replays.replay import Association
from ..replays.sources import RECORDED
from ..replays.unwitnessed import run_unwitnessed, unwitnessed
from ..scenario import DRIVER, P0, OdometrySource, TrialConfig, build, check, load_world
from ..terminal.word_order import file_in
from ..trial import TrialResult, default_mission, run_scenario
from ..usage import UsageError, choose
from .runs import Home, Run

Watch = Callable[[Step], None]


def explore(
    world: str | Path | Robot,
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
    fence: str | None = None,
    robot: str | Path | RobotSpec | None = None,
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    watch: Watch = lambda step: None,
) -> Run:
    """Explore a world, or with a robot of one's own, and return the run; `chainslam explore` as a function.

    `world` is a bundled name, a file, or a `Robot`. Of a robot of one's own nobody knows the truth: its scores are
    None, and the map's frame is its first pose. `robot` is what it states of itself: a bundled name, a YAML file or a
    `RobotSpec`. `scale` to `negate` say what a file leaves open, as the options of the command. `settings` are those
    of --set: keys of config.json and their values. `watch` sees every step. Without `out` the files go with the
    returned object. Raises UsageError, in one line, for bad input.
    """
    register_installed()
    own = None if isinstance(world, str | Path) else world
    name = str(world) if own is None else type(own).__name__
    spec = robot if isinstance(robot, RobotSpec) else None
    options = Explore(
        world=name, backend=backend, strategy=strategy, seed=seed, p0=p0, errorless=errorless, navigation=navigation,
        following=following, sweep=sweep, odometry=odometry, max_steps=max_steps, max_path=max_path,
        time_limit=time_limit, return_to_start=return_to_start, start=start,
        drawing=drawing_said(
            scale=scale, layers=tuple(layers), ids=tuple(ids), without=tuple(without), level=level,
            threshold=threshold, negate=negate,
        ),
        fence=fence,
        robot=None if robot is None or spec is not None else str(robot),
        set=tuple(_words(settings or {})),
    )  # fmt: skip
    trial = options.trial
    if spec is not None:
        trial = replace(trial, robot=trial.robot.stating(spec))
    check(trial)
    if own is None:
        drawn = load_world(trial.world, trial.start, trial.drawing)
        return _kept(*_folder(out), trial, force, lambda: run_scenario(build(trial, drawn), watch, default_mission))
    scenario = unwitnessed(replace(trial, p0="zero"), own)
    said = config_record(scenario.config) | {REPLAY: {RECORDED: asdict(RealOptions())}}
    return _kept(*_folder(out), said, force, lambda: run_unwitnessed(scenario, watch, default_mission))


@overload
def replay(
    log: str | Path | Run,
    *,
    backend: str = "full-ekf",
    association: Association = "own",
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
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    watch: Watch = ...,
) -> dict[str, Run]: ...


def replay(
    log: str | Path | Run,
    *,
    backend: str | list[str] | tuple[str, ...] = "full-ekf",
    association: Association = "own",
    settings: Mapping[str, Any] | None = None,
    out: str | Path | None = None,
    force: bool = False,
    watch: Watch = lambda step: None,
) -> Run | dict[str, Run]:
    """Send a log, or the log of a run, through one back end or several; `chainslam replay` as a function.

    Returns the run, or with several names the runs by name. Raises UsageError, in one line, for bad input.
    """
    register_installed()
    names = (backend,) if isinstance(backend, str) else tuple(backend)
    path = file_in(log.folder if isinstance(log, Run) else Path(log), "log.npz")
    command = Replay(path, backend=names, association=association, set=tuple(_words(settings or {})))
    for name in names:
        choose("back end", name, BACKENDS)
    source = command.source()
    runs: dict[str, Run] = {}
    folder, home = _folder(out)
    for name in names:
        own = folder / name if len(names) > 1 else folder
        config = source.config(name)
        runs[name] = _kept(own, home, config, force, partial(source.go, name, watch))
    return runs[backend] if isinstance(backend, str) else runs


def _words(settings: Mapping[str, Any]) -> list[str]:
    """Return settings as --set takes them."""
    return options_of(settings.items())[1::2]


def _folder(out: str | Path | None) -> tuple[Path, Home | None]:
    """Return the folder for the results, and what keeps one that nobody named."""
    if out == "":
        raise UsageError("expected a folder for out, found an empty name: leave it out, or name one")
    if out is not None:
        return Path(out).expanduser(), None
    home = Home()
    return home.folder / "run", home


def _kept(
    folder: Path,
    home: Home | None,
    config: TrialConfig | dict[str, Any],
    force: bool,
    go: Callable[[], TrialResult],
) -> Run:
    """Run in a folder, write all that came of it, and return it; raises UsageError where something was not written."""
    said = config_record(config) if isinstance(config, TrialConfig) else config
    prepare(folder)
    with held(folder):
        refuse_others(folder, said, force)
        settle(folder, said)
        problems = write_results(go(), folder, said)
    if problems:
        raise UsageError(f"expected to write a run's files, found {problems[0]}: see {folder}")
    return Run(folder, home)
