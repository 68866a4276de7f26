"""The report of a run, or of one log through several back ends: what was mapped, how well, and how honestly."""

import shlex
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.sim.logs.archive import regular
from chainslam.slam.evaluation.consistency import verdict_on_noise
from chainslam.viz import palette
from chainslam.viz.figures.maps import png
from chainslam.viz.figures.plots import draw_coverage
from chainslam.viz.reports.drawing import PageDrawing, drawing
from chainslam.viz.reports.report import Page, PagePicture, PageTable, Section, filled

from ..artifacts.maps.map_files import read_map
from ..artifacts.maps.mapped import read_corners
from ..artifacts.maps.visibility import VISIBILITY, graph_words, read_visibility
from ..artifacts.saved import read_config, read_summary
from ..artifacts.settings import FOLLOWING, NAVIGATION, differing, leaves, options_of
from ..replays.real_log import REAL_WALLS
from ..replays.replay import OPEN_TO_REPLAYS, ReplayOptions, read_options
from ..replays.sources import RECORDED, was_real
from ..scenario import STRATEGY_OF_REPLAYS, TrialConfig
from ..usage import UsageError
from .numbers import NONE, number, percent
from .pictures import draw_all, read_pictured

CAPTIONS = {
    "paths": "The way as it was, and as each back end believes it",
    "nees": "NEES of the pose: inside the band the estimate knows how wrong it is, above it, it is overconfident",
    "model": "Walls in the plane of direction and distance, with their ellipses",
    "traversals": "How often each stretch was driven",
}
FIGURES: dict[str, tuple[str, float]] = {
    "steps": ("steps", 1.0), "path_length_m": ("way driven, m", 1.0), "coverage": ("contour mapped, %", 100.0),
    "swept": ("floor seen, %", 100.0), "contours_closed": ("contours closed", 1.0),
    "contours_reachable": ("contours there are", 1.0), "open_ends": ("open ends left", 1.0), "lines": ("walls", 1.0),
    "pose_rmse_m": ("pose error, cm rms", 100.0), "heading_rmse_rad": ("heading error, degrees rms", 180.0 / np.pi),
    "odometry_max_m": ("odometry alone, worst, m", 1.0),
    "pose_anees_from_start": ("pose ANEES from the start (1 is ideal)", 1.0),
    "pose_anees": ("pose ANEES (1 is ideal)", 1.0),
    "pose_nees_in_band": ("steps in the 95 % band, %", 100.0), "map_anees": ("map ANEES (1 is ideal)", 1.0),
    "nis": ("NIS (1 is ideal)", 1.0),
    "nis_in_band": ("scans in the 95 % band of the NIS, %", 100.0),
    "false_matches": ("false matches", 1.0), "duplicate_lines": ("duplicate walls", 1.0),
    "collisions": ("collisions", 1.0), "drive_time_s": ("driving time, s", 1.0),
    "step_ms": ("computing time of a step, ms", 1.0),
}  # fmt: skip
"""What the table tells: the key of summary.json, words, and what it is multiplied by."""

LIMITS = {"--max-steps": "max_steps", "--max-path": "max_path_m", "--time-limit": "time_limit_s"}


LARGEST_PLAN = 20_000_000
"""Bytes; a floor plan of more would make the page too slow to read."""
BY_OPTION = ("mission.explorer.sweep", "mission.return_to_start", NAVIGATION, FOLLOWING)


def is_run(folder: Path) -> bool:
    """Return whether a folder holds a run, or runs of several back ends."""
    return bool(_homes(folder))


def run_page(folder: Path) -> Page:
    """Return the report of a run's folder; raises UsageError where its files do not belong to one run."""
    homes = _homes(folder)
    summaries = [read_summary(home) for home in homes]
    configs = [read_config(home / "config.json") for home in homes]
    trials = [config.trial for config in configs]
    names = [trial.backend for trial in trials]
    first = trials[0]
    is_real = was_real(configs[0].replay)
    options = ReplayOptions() if is_real else read_options(homes[0] / "config.json")
    how = (
        "The drive of a real robot"
        if is_real
        else f"A recorded drive{_by_truth(options)}"
        if first.strategy == STRATEGY_OF_REPLAYS
        else f"A robot drives by {first.strategy}"
    )
    maps = [
        PagePicture((home / "map.png").read_bytes(), f"Map by {name}")
        for home, name in zip(homes, names, strict=True)
        if (home / "map.png").is_file()
    ]
    graphs = tuple(filter(None, map(_graph, homes, names)))
    plans = tuple(filter(None, map(_plan, homes, names)))
    drawn = {} if is_real else draw_all([read_pictured(home) for home in homes if (home / "map.npz").is_file()])
    pictures = tuple(PagePicture(png(draw()), CAPTIONS[kind]) for kind, draw in drawn.items())
    curves = {name: curve for name, said in zip(names, summaries, strict=True) if (curve := said.get("coverage_curve"))}
    if curves:
        pictures = (_coverage(curves), *pictures)
    table = PageTable(
        "The run in numbers", ("what", *names),
        tuple((words, *(_told(s.get(key), scale) for s in summaries)) for key, (words, scale) in FIGURES.items()),
    )  # fmt: skip
    where = f"{how} ({Path(first.world).name})" if is_real else f"{how} in {Path(first.world).stem}, seed {first.seed}"
    return Page(
        f"{Path(first.world).stem}: {', '.join(names)}",
        f"{where}: what was mapped, how far is it off, and does the estimator know?",
        tuple(_answer(name, summary) for name, summary in zip(names, summaries, strict=True)),
        _command_real(first, names, configs[0].replay) if is_real else _command(first, names, options),
        (*configs[0].versions.items(), ("commit", str(configs[0].commit)[:10])),
        (
            *filled(
                Section("The map", _PLAN_WORDS if plans else (), pictures=tuple(maps), drawings=plans),
                Section("The visibility graph", _GRAPH_WORDS, pictures=graphs),
                Section("In numbers", tables=(table,)),
                Section("Rooms and islands", _ROOM_WORDS, tuple(filter(None, map(_rooms, homes, names)))),
                Section("Along the way", pictures=pictures),
            ),
            Section("Open ends", _open_ends(names, summaries)),
        ),
    )


_PLAN_WORDS = (
    "The floor plan has the length of each wall and the area of each room, with 95 % intervals. Point at a number to"
    " see its ends.",
)
_GRAPH_WORDS = (
    "By this the robot plans which walls to follow. Each circle is a wall, at its middle. A blue line joins neighbours"
    " in a chain; an arrow leads from a wall to one that was seen while the robot followed it.",
)
_ROOM_WORDS = (
    "Areas and lengths of the closed chains, with 95 % intervals through the joint covariance of all walls, as far as"
    " the back end knows it.",
)


def _coverage(curves: dict[str, dict[str, list[float]]]) -> PagePicture:
    arrays = {name: (np.array(curve["path_length_m"]), np.array(curve["coverage"])) for name, curve in curves.items()}
    colours = {name: palette.of_backend(name) for name in curves}
    figure = draw_coverage(arrays, colours, "How much of the reachable contour is mapped")
    return PagePicture(png(figure), "The share of the reachable contour that the map holds, against the way driven")


def _plan(home: Path, name: str) -> PageDrawing | None:
    """Return the floor plan of a run, if its folder holds one."""
    path = home / "map.svg"
    if not path.is_file() or path.stat().st_size > LARGEST_PLAN:
        return None
    return drawing(regular(path).read_bytes(), f"Floor plan by {name}, with 95 % intervals as it states them")


def _graph(home: Path, name: str) -> PagePicture | None:
    """Return the visibility graph of a run as it was drawn, with what its file says of it; None where it has none."""
    if not (home / VISIBILITY).is_file() or not (home / "visibility.png").is_file():
        return None
    words = graph_words(*read_visibility(home, read_map(home)["ids"]))
    return PagePicture((home / "visibility.png").read_bytes(), f"Visibility graph by {name}: {words}")


def _homes(folder: Path) -> list[Path]:
    if (folder / "summary.json").is_file():
        return [folder]
    return sorted(path.parent for path in folder.glob("*/summary.json"))


def _answer(name: str, summary: dict[str, Any]) -> str:
    """Return a run in one sentence."""
    if not summary.get("steps"):
        return f"{name}: {summary['status']} before its first step: {summary['reason']}."
    words = f"{name}: {summary['status']} after {number(summary['path_length_m'])} m ({summary['reason']});"
    if summary.get("coverage") is not None:
        words += f" {percent(summary['coverage'])} % of the reachable contour mapped;"
    if summary.get("pose_rmse_m") is None:
        return f"{words} {summary['lines']} walls, {number(summary['duplicate_lines'])} of them duplicates."
    words += f" the pose {_told(summary['pose_rmse_m'], 100.0)} cm off (rms)"
    anees = summary.get("pose_anees_from_start", summary.get("pose_anees"))
    if anees is not None:
        words += f", {_honest(anees)} (ANEES from the start {number(anees)}; 1 is ideal)"
    return f"{words}{_innovations(summary)}."


def _innovations(summary: dict[str, Any]) -> str:
    """Return what the scans themselves say of the noise that is stated of them; nothing where none was matched."""
    nis, share = summary.get("nis"), summary.get("nis_in_band")
    if nis is None or share is None:
        return ""
    return (
        f"; innovations are {verdict_on_noise(nis, share)} (NIS {number(nis)}, {percent(share)} % of the scans in band)"
    )


def _honest(anees: float) -> str:
    """Return what the ANEES of one run says; those of an ideal filter scatter by a factor of two or three."""
    low, high = 0.2, 3.0
    return (
        "more than it states"
        if anees > high
        else "less than it states"
        if anees < low
        else "about as much as it states"
    )


def _told(value: Any, scale: float) -> str:
    if value is None:
        return NONE
    if isinstance(value, dict):
        value = value["mean"]
    return number(value if scale == 1.0 else scale * value)


def _rooms(home: Path, name: str) -> PageTable | None:
    try:
        mapped = read_corners(home)
    except UsageError:
        return None
    rows = []
    for room in mapped.rooms:
        measured = mapped.area(room), mapped.perimeter(room)
        values = (f"{m.value:.3f} ± {m.interval[1] - m.value:.3f}" for m in measured)
        rows.append((str(room.chain), "island" if room.is_island else "room", str(len(room.corners)), *values))
    return PageTable(f"As {name} states it", ("chain", "is", "corners", "area, m²", "length, m"), tuple(rows))


def _open_ends(names: list[str], summaries: list[dict[str, Any]]) -> tuple[str, ...]:
    words = []
    for name, summary in zip(names, summaries, strict=True):
        left = summary.get("set_aside") or []
        if not summary.get("open_ends"):
            words.append(f"{name}: none is left.")
            continue
        places = (f"({end['position_m'][0]:.1f}, {end['position_m'][1]:.1f}) m: {end['why']}" for end in left)
        words.append(f"{name}: {summary['open_ends']} left. " + "; ".join(places))
    return tuple(words)


def _by_truth(options: ReplayOptions) -> str:
    """Return what the truth took the place of, in words."""
    parts = {
        "matches": options.association == "true",
        "extracted lines": options.perfect_extraction,
        "odometry": options.perfect_odometry,
    }
    told = [name for name, by_truth in parts.items() if by_truth]
    return f" with true {' and '.join(told)}" if told else ""


def _command_real(trial: TrialConfig, names: list[str], said: Any) -> str:
    """Return the command that maps a real robot's log again."""
    of_every_log = list(leaves(REAL_WALLS))
    tuned = [item for item in differing(trial) if item[0].split(".")[0] in OPEN_TO_REPLAYS and item not in of_every_log]
    words = ["chainslam", "replay", trial.world, "--backend", *names, *options_of(tuned)]
    for key, value in sorted(said[RECORDED].items()):
        option = f"--{key.replace('_', '-')}"
        words += [option] * value if isinstance(value, bool) else [option, str(value)]
    return shlex.join([*words, "--out", "DIR"])


def _command(trial: TrialConfig, names: list[str], options: ReplayOptions) -> str:
    """Return the command that makes the run again."""
    tuned = [(key, value) for key, value in differing(trial) if "." in key and key not in BY_OPTION]
    if trial.strategy == STRATEGY_OF_REPLAYS:
        tuned = [(key, value) for key, value in tuned if key.split(".")[0] in OPEN_TO_REPLAYS]
        truth = {"--perfect-extraction": options.perfect_extraction, "--perfect-odometry": options.perfect_odometry}
        words = ["chainslam", "replay", "LOG", "--backend", *names, "--association", options.association]
        return shlex.join(
            [*words, *(name for name, given in truth.items() if given), *options_of(tuned), "--out", "DIR"]
        )
    plain, mission = TrialConfig(trial.world), trial.mission
    words = ["chainslam", "explore", trial.world, "--backend", trial.backend, "--strategy", trial.strategy]
    words += ["--seed", str(trial.seed), "--p0", trial.p0, *(["--errorless"] if trial.errorless else [])]
    words += [] if trial.start is None else ["--start", *map(str, trial.start)]
    words += [] if mission.explorer.sweep else ["--no-sweep"]
    words += ["--return-to-start"] if mission.return_to_start else []
    navigation = mission.explorer.following.navigation
    words += [] if navigation == FollowingConfig.navigation else ["--navigation", navigation]
    method = mission.explorer.following.method
    words += [] if method == FollowingConfig.method else ["--following", method]
    for option, name in LIMITS.items():
        value = getattr(trial, name)
        words += [] if value == getattr(plain, name) else [option, str(value)]
    return shlex.join([*words, *options_of(tuned), "--out", "DIR"])
