"""Paths of a run as files: at its steps, or at all scans of a recorded drive."""

import numpy as np
from jaxtyping import Float

from chainslam.sim.logs.keyframes import RecordedLog
from chainslam.slam.geometry.poses import wrap

from ..scenario import OFFLINE
from ..scoring.records import Log
from ..scoring.summary import odometry_poses
from ..scoring.without_truth.smoothing import Smoothed
from ..trial import TrialResult


def trajectory(result: TrialResult, log: Log, poses_world: Float[np.ndarray, "s 3"]) -> bytes:
    """Return the poses at a run's steps, or at all scans of a recorded drive on its own clock, in the TUM format."""
    return tum(*path_of(result, log, poses_world))


def path_of(
    result: TrialResult, log: Log, poses_world: Float[np.ndarray, "s 3"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Return times and poses of a run's path: at its steps, or at all scans of a recorded drive, on its own clock."""
    recorded = result.recorded
    if recorded is None:
        return log.time_s, poses_world
    scans = recorded.poses_of_scans(poses_world)
    return recorded.scan_time_s[: len(scans)], scans


def estimated_path(result: TrialResult, log: Log) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Return the same for the estimated path; without a back end that is the smoothed one."""
    smoothed = result.smoothed if result.scenario.config.backend == OFFLINE else None
    return path_of(result, log, log.estimated_world) if smoothed is None else smoothed_path(result, log, smoothed)


def smoothed_path(
    result: TrialResult, log: Log, smoothed: Smoothed
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Return the same for the smoothed path, where a scan between two keyframes is interpolated from both."""
    recorded = result.recorded
    if recorded is None:
        return log.time_s, smoothed.poses_world
    scans = recorded.smoothed_poses_of_scans(smoothed.poses_world)
    return recorded.scan_time_s[: len(scans)], scans


def wheels_alone(log: Log, recorded: RecordedLog) -> Float[np.ndarray, "s 3"]:
    """Return the path of a recorded robot's wheel odometry, from the start of the estimate."""
    return odometry_poses(log.estimated_world[0], recorded.recording.odometry[: len(log)])


def tum(time_s: Float[np.ndarray, " s"], poses_world: Float[np.ndarray, "s 3"]) -> bytes:
    """Return poses in the TUM format: t x y z qx qy qz qw."""
    half = 0.5 * wrap(poses_world[:, 2])
    rows = zip(time_s, poses_world[:, 0], poses_world[:, 1], np.sin(half), np.cos(half), strict=True)
    return "".join(f"{t:.6f} {x:.9f} {y:.9f} 0 0 0 {qz:.12f} {qw:.12f}\n" for t, x, y, qz, qw in rows).encode()
