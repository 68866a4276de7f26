"""The report of a run, or of one log through several back ends: its tables and pictures."""

import shlex
from collections.abc import Collection, Mapping, Sequence
from contextlib import suppress
from math import degrees
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.sim.logs.archive import regular
from chainslam.slam.evaluation.consistency import NOISE_MODELS, noise_model
from chainslam.viz import palette
from chainslam.viz.figures.maps import Picture, saved
from chainslam.viz.figures.panels import map_figures
from chainslam.viz.figures.plots import draw_coverage
from chainslam.viz.reports.drawing import PageDrawing, drawing
from chainslam.viz.reports.report import Page, PagePicture, PageTable, table
from chainslam.viz.text import NONE

from ..artifacts.maps.map_files import read_map
from ..artifacts.maps.mapped import read_corners
from ..artifacts.maps.visibility import VISIBILITY, graph_words, read_visibility
from ..artifacts.saved import read_config, read_summary
from ..artifacts.settings import KEYS, differing, leaves, options_of
from ..replays.real_log import REAL_WALLS
from ..replays.replay import OPEN_TO_REPLAYS, ReplayOptions, read_options
from ..replays.sources import RECORDED, was_real
from ..scenario import OFFLINE, STRATEGY_OF_REPLAYS, TrialConfig
from ..scoring.maps.measurements import Measured
from ..usage import UsageError
from .measured import measured_tables
from .numbers import listed, number
from .pictures import PicturedRun, draw_all, read_pictured, read_steps
from .run_lines import SCATTER, lines_of, notes_of
from .saved_map import picture_alone, saved_map, small_map

Row = dict[str, Any]
FIGURES: dict[str, tuple[str, float]] = {
    "steps": ("steps", 1.0), "path_length_m": ("path length, m", 1.0), "coverage": ("contour mapped, %", 100.0),
    "coverage_own_frame": ("contour mapped, path aligned, %", 100.0), "swept": ("floor seen, %", 100.0),
    "contours_closed": ("contours closed", 1.0), "contours_reachable": ("contours to be closed", 1.0),
    "open_ends": ("open ends left", 1.0), "chains_closed": ("closed chains", 1.0), "lines": ("walls", 1.0),
    "pose_rmse_m": ("pose error, cm", 100.0), "heading_rmse_rad": ("heading error, degrees", degrees(1.0)),
    "odometry_max_m": ("largest error of odometry alone, m", 1.0), "pose_anees_from_start": ("pose ANEES", 1.0),
    "pose_anees": ("pose ANEES with the start's error", 1.0),
    "pose_nees_in_band": ("steps in the 95 % band with the start's error, %", 100.0), "map_anees": ("map ANEES", 1.0),
    "nis": ("NIS", 1.0), "nis_in_band": ("scans in the 95 % band of the NIS, %", 100.0),
    "noise": ("sensor noise, by the NIS", 1.0),
    "false_matches": ("false matches", 1.0), "duplicate_lines": ("duplicate walls", 1.0),
    "refined_lines": ("walls after offline refinement", 1.0),
    "refined_duplicate_lines": ("duplicate walls after it", 1.0),
    "refined_closures": ("loop closures", 1.0), "collisions": ("collisions", 1.0),
    "drive_time_s": ("driving time, s", 1.0),
    "step_ms": ("computing time per step, ms", 1.0),
}  # fmt: skip
"""Rows of the table: the key of summary.json, name and factor."""
APART = (
    *("pose_rmse_m", "heading_rmse_rad", "pose_anees_from_start", "map_anees", "pose_nees_in_band", "nis"),
    *("false_matches", "duplicate_lines", "lines", "refined_lines", "chains_closed", "step_ms"),
)
CAPTIONS = {
    "nees": "NEES of the pose relative to the start", "paths": "Estimated paths, the true one and odometry alone",
    "model": "Walls by direction and distance, with their 3σ ellipses",
    "traversals": "How often each stretch was driven",
}  # fmt: skip
VECTORS = ("nees", "paths")
"""Pictures with few enough lines to be drawn as vectors."""
LARGEST_PLAN = 20_000_000
"""Bytes; a larger floor plan would make the page too slow."""


def is_run(folder: Path) -> bool:
    """Return whether a folder holds a run, or runs of several back ends."""
    return bool(homes_of(folder))


def run_page(folder: Path) -> Page:
    """Return the report of a run's folder; raises UsageError if its files do not belong to one run."""
    homes = homes_of(folder)
    summaries = [read_summary(home) for home in homes]
    configs = [read_config(home / "config.json") for home in homes]
    trials = [config.trial for config in configs]
    names = [trial.backend for trial in trials]
    first, is_real = trials[0], was_real(configs[0].replay)
    options = ReplayOptions() if is_real else read_options(homes[0] / "config.json")
    runs = [summary | _more(summary) | {"backend": name} for name, summary in zip(names, summaries, strict=True)]
    mapped = [home for home in homes if (home / "map.npz").is_file()]
    pictured = {} if is_real else {home: read_pictured(home) for home in mapped}
    pictures = {
        name: (PagePicture(saved(draw(), "svg" if name in VECTORS else "png"), CAPTIONS[name]),)
        for name, draw in draw_all([*pictured.values()]).items()
    }
    refined = [run["backend"] for run in runs if run.get("second_looks")]
    lines = lines_of(runs)
    replayed = first.strategy == STRATEGY_OF_REPLAYS
    return Page(
        f"{Path(first.world).name if is_real else Path(first.world).stem}: {listed(names)}",
        lines[::-1] if is_real or len(names) > 1 else lines,
        _command_real(first, names, configs[0].replay) if is_real else _command(first, names, options),
        (*configs[0].versions.items(), ("commit", str(configs[0].commit)[:10])),
        template="run",
        told={
            "real": is_real, "moved": any(run["steps"] for run in runs), "several": len(names) > 1,
            "replayed": replayed, "true": _by_truth(options) if replayed else (), "seed": first.seed,
            "strategy": first.strategy, "scatter": SCATTER, "errorless": first.errorless,
            "notes": {name: notes for name, run in zip(names, runs, strict=True) if (notes := notes_of(run))},
        },
        tables={
            "estimators": _estimators(runs), "numbers": _numbers(runs), **measured_tables(runs),
            "distances": _distances(runs), "ends": _open_ends(runs), "rooms": _rooms(homes, names),
        },
        pictures={
            **{name: () for name in ("nees", "paths", "model", "traversals")}, **pictures,
            "maps": _maps(homes, names), "small": _small_maps(mapped, pictured) if len(mapped) > 1 else (),
            "coverage": _coverage(runs), "graphs": _graphs(homes, names, refined),
        },
        drawings=tuple(filter(None, map(_plan, homes, names if len(names) > 1 else [""]))),
    )  # fmt: skip


def homes_of(folder: Path) -> list[Path]:
    """Return the folders of the runs in a folder: its own, or one for each back end; empty without a run."""
    if (folder / "summary.json").is_file():
        return [folder]
    return sorted(path.parent for path in folder.glob("*/summary.json"))


def _numbers(runs: Sequence[Row]) -> PageTable:
    """Return a row for each quantity that some run has, with a column for each run."""
    columns = {"quantity": lambda key: FIGURES[key][0]} | {
        run["backend"]: (lambda key, run=run: _told(run.get(key), FIGURES[key][1])) for run in runs
    }
    known = [key for key in FIGURES if any(run.get(key) is not None for run in runs)]
    return table("The run in numbers", columns, known)


def _estimators(runs: Sequence[Row]) -> PageTable:
    """Return a row for each run, with the figures that distinguish estimators."""
    known = [key for key in APART if any(run.get(key) is not None for run in runs)]
    columns = {FIGURES[key][0]: (lambda run, key=key: _told(run.get(key), FIGURES[key][1])) for key in known}
    return table("Estimators", {"estimator": lambda run: run["backend"], **columns}, runs)


def _told(value: Any, scale: float) -> str:
    if isinstance(value, dict):
        value = value["mean"]
    if value is None or isinstance(value, str):
        return value or NONE
    return number(value if scale == 1.0 else scale * value)


def _more(run: Row) -> Row:
    """Return further figures of a run: the verdict of the NIS on the stated noise, and those of offline refinement."""
    nis, share = run.get("nis"), run.get("nis_in_band")
    noise = None if nis is None or share is None else NOISE_MODELS[noise_model(nis, share)]
    return {"noise": noise} | {f"refined_{key}": value for key, value in (run.get("second_looks") or {}).items()}


def _distances(runs: Sequence[Row]) -> PageTable:
    """Return the distances between corners that the world's file names, mapped and true."""
    rows = [
        {"estimator": run["backend"], "corners": pair, **found}
        for run in runs
        for pair, found in (run.get("distances") or {}).items()
        if found["mapped_m"] is not None
    ]
    columns = {"corners": lambda row: row["corners"], "estimator": lambda row: row["estimator"]}
    numbers = {"mapped, m": ("mapped_m", 5), "stated sigma, m": ("sigma_m", 3), "true, m": ("true_m", 5)}
    told = {words: (lambda row, key=key, n=n: number(row[key], n)) for words, (key, n) in numbers.items()}
    return table("Distances", columns | told, rows)


def _open_ends(runs: Sequence[Row]) -> PageTable:
    ends = [{"estimator": run["backend"], **end} for run in runs for end in run.get("set_aside") or ()]
    return table("Open ends", {
        "estimator": lambda end: end["estimator"],
        "x, y, m": lambda end: f"{end['position_m'][0]:.1f}, {end['position_m'][1]:.1f}", "why": lambda end: end["why"],
    }, ends)  # fmt: skip


def _rooms(homes: Sequence[Path], names: Sequence[str]) -> PageTable:
    """Return the closed chains of the runs whose maps have corners."""
    rows = []
    for home, name in zip(homes, names, strict=True):
        with suppress(UsageError):
            mapped = read_corners(home)
            rows += [(name, room, _measured(mapped.area(room)), _measured(mapped.perimeter(room)))
                     for room in mapped.rooms]  # fmt: skip
    return table("Rooms and islands", {
        "chain": lambda row: str(row[1].chain), "estimator": lambda row: row[0],
        "kind": lambda row: "island" if row[1].is_island else "room",
        "corners": lambda row: str(len(row[1].corners)), "area, m²": lambda row: row[2],
        "perimeter, m": lambda row: row[3],
    }, rows)  # fmt: skip


def _measured(found: Measured) -> str:
    return f"{found.value:.3f} ± {found.interval[1] - found.value:.3f}"


def _coverage(runs: Sequence[Row]) -> tuple[PagePicture, ...]:
    found = {run["backend"]: curve for run in runs if (curve := run.get("coverage_curve"))}
    if not found:
        return ()
    curves = {name: (np.array(c["path_length_m"]), np.array(c["coverage"])) for name, c in found.items()}
    figure = draw_coverage(curves, {name: palette.of_backend(name) for name in curves})
    return (PagePicture(saved(figure, "svg"), "Share of the reachable contour that the map holds"),)


def _maps(homes: Sequence[Path], names: Sequence[str]) -> tuple[PagePicture, ...]:
    return tuple(
        PagePicture((home / "map.png").read_bytes(), name)
        for home, name in zip(homes, names, strict=True)
        if (home / "map.png").is_file()
    )


def _small_maps(homes: Sequence[Path], pictured: Mapping[Path, PicturedRun]) -> tuple[PagePicture, ...]:
    """Return the maps of several runs in one world, at one scale; of those that know the truth, over the true floor."""
    maps = {home.name: small_map(_picture(home, pictured.get(home))) for home in homes}
    return tuple(
        PagePicture(saved(figure, "svg"), name)
        for name, figure in zip(maps, map_figures([*maps.values()]), strict=True)
    )


def _picture(home: Path, run: PicturedRun | None) -> Picture:
    if run is None:
        return picture_alone(home, read_steps(home)[:, :3])
    return saved_map(home, run.trial, run.log, run.walls, run.estimated_world)


def _plan(home: Path, name: str) -> PageDrawing | None:
    """Return the floor plan of a run, if its folder holds one."""
    path = home / "map.svg"
    if not path.is_file() or path.stat().st_size > LARGEST_PLAN:
        return None
    return drawing(regular(path).read_bytes(), name)


def _graphs(homes: Sequence[Path], names: Sequence[str], refined: Collection[str]) -> tuple[PagePicture, ...]:
    """Return the visibility graphs as they were drawn, with what their files say of them.

    After offline refinement (`refined` back ends) a graph is of other walls than the map.
    """
    return tuple(
        PagePicture((home / "visibility.png").read_bytes(), f"{name}: {_graph_words(home)}")
        for home, name in zip(homes, names, strict=True)
        if (home / VISIBILITY).is_file() and (home / "visibility.png").is_file() and name not in refined
    )


def _graph_words(home: Path) -> str:
    return graph_words(*read_visibility(home, read_map(home)["ids"]))


def _by_truth(options: ReplayOptions) -> tuple[str, ...]:
    """Return which parts were replaced by the truth."""
    parts = {"matches": options.association == "true", "extracted lines": options.perfect_extraction}
    return tuple(name for name, by_truth in (parts | {"odometry": options.perfect_odometry}).items() if by_truth)


def _command_real(trial: TrialConfig, names: list[str], said: Any) -> str:
    """Return the command that maps a real robot's log again."""
    of_every_log = list(leaves(REAL_WALLS))
    tuned = [item for item in differing(trial) if item[0].split(".")[0] in OPEN_TO_REPLAYS and item not in of_every_log]
    named = [] if names == [OFFLINE] else ["--backend", *names]
    words = ["chainslam", "replay", trial.world, *named, *options_of(tuned)]
    for key, value in sorted(said[RECORDED].items()):
        words += [] if value is False else _option(key, value)
    return shlex.join([*words, "--out", "DIR"])


def _command(trial: TrialConfig, names: list[str], options: ReplayOptions) -> str:
    """Return the command that makes the run again."""
    if trial.strategy == STRATEGY_OF_REPLAYS:
        tuned = [(key, value) for key, value in differing(trial) if key.split(".")[0] in OPEN_TO_REPLAYS]
        truth = {"perfect_extraction": options.perfect_extraction, "perfect_odometry": options.perfect_odometry}
        words = ["chainslam", "replay", "LOG", "--backend", *names, "--association", options.association]
        words += [word for key, given in truth.items() if given for word in _option(key, given)]
        return shlex.join([*words, *options_of(tuned), "--out", "DIR"])
    options_by_key = {key: name for name, key in KEYS.items()}
    words = ["chainslam", "explore", trial.world, "--backend", trial.backend, "--strategy", trial.strategy]
    words += ["--seed", str(trial.seed)]
    others = [item for item in differing(trial) if item[0] not in ("world", "backend", "strategy", "seed")]
    for key, value in others:
        words += _option(options_by_key[key], value) if key in options_by_key else options_of([(key, value)])
    return shlex.join([*words, "--out", "DIR"])


def _option(name: str, value: Any) -> list[str]:
    option = name.replace("_", "-")
    if isinstance(value, bool):
        return [f"--{option}" if value else f"--no-{option}"]
    return [f"--{option}", *map(str, value if isinstance(value, list) else [value])]
