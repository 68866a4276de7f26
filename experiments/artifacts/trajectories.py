"""Paths of a run as files: of its steps, or of all scans of a recorded drive."""

import numpy as np
from jaxtyping import Float

from chainslam.sim.logs.keyframes import RecordedLog
from chainslam.slam.geometry.poses import wrap

from ..scoring.records import Log
from ..scoring.summary import odometry_poses
from ..scoring.without_truth.smoothing import Smoothed
from ..trial import TrialResult


def trajectory(result: TrialResult, log: Log, poses_world: Float[np.ndarray, "s 3"]) -> bytes:
    """Return the poses of a run's steps in the TUM format; of a recorded drive those of all its scans, on its clock."""
    return tum(*path_of(result, log, poses_world))


def path_of(
    result: TrialResult, log: Log, poses_world: Float[np.ndarray, "s 3"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Return times and poses of a run's path: of its steps, or of all scans of a recorded drive, on its own clock."""
    recorded = result.recorded
    if recorded is None:
        return log.time_s, poses_world
    scans = recorded.poses_of_scans(poses_world)
    return recorded.scan_time_s[: len(scans)], scans


def smoothed_path(
    result: TrialResult, log: Log, smoothed: Smoothed
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 3"]]:
    """Return the same of the smoothed path: a scan between two keyframes knows both."""
    recorded = result.recorded
    if recorded is None:
        return log.time_s, smoothed.poses_world
    scans = recorded.smoothed_poses_of_scans(smoothed.poses_world)
    return recorded.scan_time_s[: len(scans)], scans


def wheels_alone(log: Log, recorded: RecordedLog) -> Float[np.ndarray, "s 3"]:
    """Return where wheel odometry puts a recorded robot, from where the estimate begins."""
    return odometry_poses(log.estimated_world[0], recorded.recording.odometry[: len(log)])


def tum(time_s: Float[np.ndarray, " s"], poses_world: Float[np.ndarray, "s 3"]) -> bytes:
    """Return poses in the TUM format: t x y z qx qy qz qw."""
    half = 0.5 * wrap(poses_world[:, 2])
    rows = zip(time_s, poses_world[:, 0], poses_world[:, 1], np.sin(half), np.cos(half), strict=True)
    return "".join(f"{t:.6f} {x:.9f} {y:.9f} 0 0 0 {qz:.12f} {qw:.12f}\n" for t, x, y, qz, qw in rows).encode()
