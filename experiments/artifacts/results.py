"""The folder of a trial: everything needed to look at it, score it again, replay it and run it again."""

import platform
import subprocess
from collections.abc import Callable
from dataclasses import replace
from functools import cache
from importlib.metadata import PackageNotFoundError, version
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np

from chainslam.slam.evaluation.consistency import pose_errors
from chainslam.viz.floor_plan import Dimension, floor_plan
from chainslam.viz.shapes import with_gaps

from ..scenario import OFFLINE, TrialConfig
from ..scoring.innovations import nis_in_band, windowed_nis
from ..scoring.keys import Steps
from ..scoring.records import Log
from ..scoring.summary import odometry_path, pose_nees, pose_nees_from_start
from ..trial import TrialResult
from .files import CONFIG, csv_bytes, json_bytes, npz_bytes, stamp, write
from .maps.dimensions import dimensions
from .maps.drawn_floor import drawn_floor
from .maps.dxf import map_dxf
from .maps.geojson import map_geojson
from .maps.mapped import corners_of
from .maps.occupancy import occupancy_files
from .maps.visibility import VISIBILITY, visibility_record
from .settings import own
from .trajectories import estimated_path, smoothed_path, trajectory, tum, wheels_alone

PACKAGES = ("chainslam", "numpy", "scipy", "shapely", "networkx", "matplotlib")
LOG, SUMMARY, MAP = "log.npz", "summary.json", "map.npz"
RUNNING = "log.running"
"""The log during the run; it is removed once all results are written."""
RECORDING = "run.rrd"
RUN_FILES = (
    *(CONFIG, SUMMARY, "failure.txt", LOG, RUNNING, MAP, "map.geojson", "map.svg", "map.dxf", "map.png"),
    *(VISIBILITY, "visibility.png", "map.pgm", "map.yaml", "steps.csv"),
    *(f"trajectory_{name}.tum" for name in ("true", "estimated", "smoothed", "odometry")),
    *(RECORDING, "report.html", "tables.tex"),
)
"""All files of a run, and those that `view` and `report` add to its folder."""
REPLAY = "replay"
"""Key in `config.json` of the options of a replay; null for an exploration."""


def write_results(result: TrialResult, folder: Path, config: dict[str, Any] | None = None) -> list[str]:
    """Write every file of a trial into `folder`, and return, in words, what could not be written and why.

    `config` is what `config.json` holds, by default the record of the trial's settings. One file that fails does not
    cost the others.
    """
    problems: dict[str, list[str]] = {}
    for name, make in _files(result, config or config_record(result.scenario.config)).items():
        try:
            write(folder / name, make())
        except Exception as error:  # one file that cannot be written must not cost the other results
            known = error.strerror if isinstance(error, OSError) else None
            why = known or f"{type(error).__name__}: {' '.join(str(error).split())}"
            problems.setdefault(why, []).append(name)
    if not result.ending.traceback:
        (folder / "failure.txt").unlink(missing_ok=True)
    return [f"{', '.join(names)}: {why}" for why, names in problems.items()]


def _files(result: TrialResult, config: dict[str, Any]) -> dict[str, Callable[[], bytes]]:
    files: dict[str, Callable[[], bytes]] = {
        CONFIG: lambda: json_bytes(config),
        SUMMARY: lambda: json_bytes(stamp() | result.summary),
    }
    if result.ending.traceback:
        files["failure.txt"] = lambda: result.ending.traceback.encode()
    log, last, certificate = result.log, result.last, result.certificate
    if log is None or last is None or certificate is None:
        return files
    smoothed, recorded = result.smoothed, result.recorded
    if smoothed is not None:
        files["trajectory_smoothed.tum"] = lambda: tum(*smoothed_path(result, log, smoothed))
    if recorded is None:
        files["trajectory_true.tum"] = lambda: trajectory(result, log, log.true_world)
    else:
        files["trajectory_odometry.tum"] = lambda: trajectory(result, log, wheels_alone(log, recorded))
    # After offline refinement the map is saved together with the smoothed path.
    shown = log if recorded is None or smoothed is None else replace(log, estimated_world=smoothed.poses_world)
    drawn = cache(lambda: map_geojson(last, result.joint, certificate, shown))
    told = cache(lambda: _dimensions(result, drawn()["features"]))
    name = result.scenario.config.backend
    title = f"{result.scenario.world.name}, mapped {'' if name == OFFLINE else 'by '}{name}"
    files |= {
        LOG: lambda: npz_bytes(log_arrays(result, log)),
        MAP: lambda: npz_bytes(map_arrays(result)),
        "map.geojson": lambda: json_bytes(drawn()),
        "steps.csv": lambda: steps_csv(log),
        "trajectory_estimated.tum": lambda: tum(*estimated_path(result, log)),
        "map.svg": lambda: floor_plan(
            last.map, last.chains, certificate, with_gaps(shown.estimated_world, log.carried), title, told()
        ),
        "map.dxf": lambda: map_dxf(drawn()["features"], told(), title),
        "map.png": lambda: _pictures().picture_of(result),
    }
    # Offline refinement follows no walls from scan to scan, and external programs keep none.
    if result.scenario.config.backend != OFFLINE and result.summary["lines"] is not None:
        files[VISIBILITY] = lambda: json_bytes(visibility_record(last, log))
        files["visibility.png"] = lambda: _pictures().graph_png(result)
    floor = last.free_space
    if recorded is not None and not floor.evidence.size:  # A recorded drive has no planner, hence no planned routes.
        floor = drawn_floor(recorded.recording, shown.estimated_world, result.scenario.config.mission.free_space)
    if np.any(floor.evidence):
        ros_map = cache(lambda: occupancy_files(floor, shown.estimated_world[0]))
        files |= {"map.pgm": lambda: ros_map()[0], "map.yaml": lambda: ros_map()[1]}
    return files


def _dimensions(result: TrialResult, features: list[dict[str, Any]]) -> list[Dimension]:
    """Return lengths and areas as `measure` reports them; none if the covariance is lost."""
    arrays = map_arrays(result)
    if not np.all(np.isfinite(arrays["cov"])):
        return []
    found = {kind: [f for f in features if f["properties"]["kind"] == kind] for kind in ("corner", "chain")}
    return dimensions(corners_of(arrays, found["corner"], found["chain"]))


def config_record(config: TrialConfig) -> dict[str, Any]:
    """Return everything needed to run a trial again, with the versions that ran it."""
    versions = {"python": platform.python_version()}
    for package in PACKAGES:
        try:
            versions[package] = version(package)
        except PackageNotFoundError:
            continue
    return {**stamp(), "trial": own(config), "versions": versions, "commit": _commit()}


def _pictures() -> ModuleType:
    # Importing matplotlib takes as long as everything else, and the workers of a campaign draw nothing.
    from .maps import picture

    return picture


def _commit() -> str | None:
    """Return the commit of the sources, with a plus sign if files have changed since; None outside git."""
    here = Path(__file__).parent
    try:
        words = [
            subprocess.run(
                ["git", "-C", str(here), *args], capture_output=True, text=True, timeout=10, check=True
            ).stdout
            for args in (("rev-parse", "HEAD"), ("status", "--porcelain", "--untracked-files=no"))
        ]
    except (OSError, subprocess.SubprocessError):
        return None
    return words[0].strip() + ("+" if words[1].strip() else "")


def log_arrays(result: TrialResult, log: Log) -> dict[str, Any]:
    """Return the run's own log: what the robot reported, and under `true_*` what only experiments read."""
    return {
        **stamp(),
        **_sensed(result, log),
        **({} if result.recorded is not None else _true(result, log)),
    }


def _sensed(result: TrialResult, log: Log) -> dict[str, Any]:
    recorded = result.recorded
    # Scan matching replaces the reported wheel odometry in the estimate; the log keeps the reports.
    wheels = log if recorded is None else recorded.recording
    return {
        "time_s": log.time_s,
        "scan_start_s": log.scan_start_s,
        "bearings_rad": log.bearings_rad,
        **({} if log.fans is None else {"fans": log.fans}),
        "ranges_m": log.ranges_m,
        "sigma_m": log.sigma_m,
        "sigma_share": log.sigma_share,
        **({"resolution_m": log.resolution_m} if log.resolution_m > 0.0 else {}),
        "range_max_m": log.range_max_m,
        "odometry": wheels.odometry[: len(log)],
        "odometry_cov": wheels.odometry_cov[: len(log)],
        "touched": log.touched,
        **({} if log.carried is None else {"carried": log.carried}),
        "start_pose": result.scenario.start_estimate,
        "start_cov": result.scenario.start_cov,
    }


def _true(result: TrialResult, log: Log) -> dict[str, Any]:
    return {
        "true_poses": log.true_world,
        "true_faces": result.votes.truth.faces,
        "true_face_of_beam": log.face_of_beam,
        "true_wall_of_face": result.votes.truth.walls,
        "true_ring_of_face": result.votes.truth.rings,
    }


def map_arrays(result: TrialResult) -> dict[str, Any]:
    """Return the final map: lines are (alpha rad, d m) about their anchors, NaN for a lost covariance.

    It is that of the last step, or of the smoothed solution if there is one.
    """
    if result.last is None:
        raise ValueError("expected a run of at least one step, found none: there is no map")
    final = result.smoothed
    walls, joint = (result.last.map, result.joint) if final is None else (final.map, final.joint)
    size = 3 + 2 * len(walls)
    return {
        **stamp(),
        "pose": walls.belief.pose_world,
        "ids": walls.ids,
        "lines": walls.belief.means,
        "lines_world": walls.belief.lines_world,
        "anchors": walls.belief.anchors,
        "extents": walls.extents,
        "sightings": walls.observations,
        "tentative": walls.tentative,
        "crooked": walls.crooked,
        "cov": np.full((size, size), np.nan) if joint is None else joint.cov,
        "true_faces_of_lines": result.votes.faces_of(walls.ids),
    }


def steps_csv(log: Log) -> bytes:
    """Return a row for each step; its errors are the invariant ones that the NEES is computed from."""
    sigmas = np.sqrt(np.diagonal(log.estimated_cov, axis1=1, axis2=2))
    rows, columns_of_cov = np.triu_indices(3)
    wheels = np.hypot(*(odometry_path(log) - log.true_world)[:, :2].T)
    columns = [
        np.arange(len(log)),
        log.time_s,
        log.path_length_m,
        pose_nees(log),
        np.trace(log.estimated_cov, axis1=1, axis2=2),
        log.open_ends,
        log.lines,
        log.tentative,
        pose_nees_from_start(log),
        log.closed_chains,
        log.set_aside,
        *log.estimated_world.T,
        *log.true_world.T,
        *pose_errors(log.estimated_world, log.true_world).T,
        *sigmas.T,
        *log.estimated_cov[:, rows, columns_of_cov].T,
        wheels,
        np.cumsum(log.touched),
        log.nis,
        log.nis_dof,
        windowed_nis(log),
        nis_in_band(log).astype(int),
        log.unstated_motion.astype(int),
        log.is_lost.astype(int),
        log.wheel_noise_factor,
        log.behaviours,
        log.route_walls,
        log.reasons,
        1e3 * log.seconds,
    ]
    return csv_bytes(tuple(Steps.__annotations__), zip(*columns, strict=True))
