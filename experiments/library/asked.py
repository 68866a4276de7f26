"""Conversion of the options of a command or a function call to the settings of a trial, log or campaign."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from pathlib import Path
from typing import Any, Literal

from chainslam.sim.logs.recorded_log import is_own_log
from chainslam.sim.logs.recorded_robot import knows_truth

from ..artifacts.fences import fence_of
from ..artifacts.presets import PresetName, against_methods, preset_of, robot_of, stated
from ..artifacts.settings import (
    DRAWING,
    FOLLOWING,
    KEYS,
    NAVIGATION,
    Record,
    asked,
    differing,
    nested,
    over,
    read_settings,
    trial_of,
)
from ..campaign.plan import ARMS, CLOSED, DECIDED, MAX_STEPS, PRESETS, Campaign
from ..replays.real_log import RealOptions, read_own_run, read_real_run
from ..replays.replay import ReplayOptions, read_run, retuned
from ..replays.sources import OwnLog, RealLog
from ..scenario import DRIVER, TrialConfig, load_world
from ..terminal.console import say
from ..usage import UsageError

CampaignName = Literal["smoke", "paper", "paper-method", "full"]
SETTLED = (
    *("world", "backend", "strategy", "seed", "p0", "errorless", "sweep", "navigation", "following", "odometry"),
    *("start", "map", *DRAWING, "fence", "preset", "robot", "config", "set"),
)
"""Options that a saved run determines; only its limits may change when it is continued."""


def asked_trial(
    said: Mapping[str, Any],
    drawing: Record,
    fence: str | None,
    preset: PresetName | None,
    robot: str | None,
    config: Path | None,
    settings: Iterable[Record],
) -> TrialConfig:
    """Return the settings of a run; options override settings, then come --config, the robot and the preset.

    `said` are the given options (`KEYS`), `drawing` those of the world's file by their dotted keys. Raises UsageError
    if no world is given, or if a value is invalid.
    """
    plain = {name: list(value) if isinstance(value, tuple) else value for name, value in said.items()}
    given = {KEYS[name]: str(value) if isinstance(value, Path) else value for name, value in plain.items()} | drawing
    if fence is not None:
        given["mission.free_space.fence"] = fence_of(fence)
    base = {} if config is None else read_settings(config)
    trial = trial_of({"backend": DRIVER}, preset_of(preset), robot_of(robot), base, *settings, nested(given.items()))
    if not trial.world:
        raise UsageError("expected a WORLD or --resume DIR, found neither: name one")
    return trial


def refuse_settled(names: Iterable[str]) -> None:
    """Raise UsageError for an option that a saved run determines."""
    for name in names:
        raise UsageError(
            f"expected only limits and --out with --resume, found {name}: leave it out, the saved run decides it"
        )


def continued(
    saved: TrialConfig, max_steps: int | None, max_path: float | None, time_limit: float | None, return_to_start: bool
) -> TrialConfig:
    """Return the settings of a saved run with the given limits, or with its own if none is given."""
    home = return_to_start or saved.mission.return_to_start
    going_on = replace(saved, mission=replace(saved.mission, return_to_start=home))
    if max_steps is max_path is time_limit is None:
        return going_on
    steps = TrialConfig.max_steps if max_steps is None else max_steps
    return replace(going_on, max_steps=steps, max_path_m=max_path, time_limit_s=time_limit)


def asked_source(
    path: Path, own: ReplayOptions, real: RealOptions, robot: str | None, config: Path | None, settings: Record
) -> OwnLog | RealLog:
    """Read a log for a replay with these options; raises UsageError for an invalid log or option."""
    spec = stated(robot_of(robot))
    is_own = is_own_log(path)
    if is_own and real.every != 1:
        raise UsageError(f"expected --every with a real robot's log, found {path.name}: leave it out")
    if is_own and (real.scan_topic or real.odom_topic):
        raise UsageError(f"expected a ROS bag for --scan-topic and --odom-topic, found {path.name}: leave them out")
    if is_own and knows_truth(path):
        if real.range_noise is not None:
            raise UsageError(
                f"expected --range-noise with a log that does not state it, found {path.name}: leave it out"
            )
        run = retuned(read_run(path), config, settings, spec)
        return OwnLog(run, own, load_world(run.trial.world, run.trial.start, run.trial.drawing))
    if own.association != "own" or own.perfect_extraction or own.perfect_odometry:
        raise UsageError(
            "expected a log with the truth for --association true, --perfect-extraction and"
            f" --perfect-odometry, found {path.name}: leave them out"
        )
    read = read_own_run if is_own else read_real_run
    source = RealLog(read(path, real, config, settings, spec))
    log, name = source.run.log, path.resolve().name
    cut = f"{log.trouble}: {len(log.scan_time_s)} scans before it are used" if log.trouble else ""
    for words in filter(None, (*log.notes, log.left_out.words(len(log.scan_time_s)), cut)):
        say(f"chainslam: {name}: {words}", stderr=True)
    return source


def asked_campaign(
    cells: Mapping[str, Any],
    said: Mapping[str, Any],
    drawing: Record,
    preset: CampaignName | None,
    robot: str | None,
    config: Path | None,
    settings: Record,
    *,
    modes: Sequence[str],
    association: Sequence[str],
    driver: str,
    first_seed: int,
    external: Sequence[tuple[str, str]] = (),
) -> Campaign:
    """Return a campaign; raises UsageError if something is missing.

    `cells` are worlds, back ends, strategies and trials, None to take them from the preset; `said` are the given
    options among navigation, following, errorless, p0 and max_steps. `external` are names and commands of programs of
    others, which ride along on the recorded drives.
    """
    begin = dict(PRESETS[preset]) if preset else {}
    ruling = over(nested(begin.pop("settings", ())), robot_of(robot), asked(config, settings, DECIDED))
    keys = {"navigation": NAVIGATION, "following": FOLLOWING, "errorless": "errorless"}
    ruling = over(ruling, nested((keys[name], value) for name, value in said.items() if name in keys))
    ruling = over(ruling, nested(drawing.items()))
    named: Record = {name: ruling.pop(name) for name in ("p0", "max_steps") if name in ruling}
    named |= {name: value for name, value in said.items() if name not in keys}
    named |= {name: value for name, value in cells.items() if value is not None}
    chosen = {"max_steps": MAX_STEPS} | begin | named
    missing = [f"--{name}" for name in cells if name not in chosen]
    if missing:
        raise UsageError(f"expected {', '.join(missing)} or a --preset, found none: name them")
    chosen["backends"] = (*chosen["backends"], *(name for name, _ in external))
    arms = [arm for arm in ARMS if arm == CLOSED and CLOSED in modes]
    arms += [f"replay-{name}" for name in ("own", "true") if "replay" in modes and name in association]
    changed = differing(trial_of(ruling)) + against_methods(chosen["backends"], ruling)
    return Campaign(
        **chosen, arms=tuple(arms), driver=driver, first_seed=first_seed, settings=tuple(sorted(dict(changed).items())),
        external=tuple(external),
    )  # fmt: skip
