"""The keys of summary.json, as DESIGN.md section 6 defines them."""

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.explore.outcome import Outcome
from chainslam.explore.step import Step
from chainslam.slam.estimation.backend import POSE, Joint
from chainslam.slam.evaluation.consistency import anees, joint_error, nees, pose_covariances, pose_errors, share_in_band
from chainslam.slam.extraction.curved_share import SCANS
from chainslam.slam.geometry.poses import compose, to_world, wrap

from ..scenario import Scenario
from .association import Votes, duplicate_lines
from .innovations import innovation_scores
from .maps.corners import corners, label_distances
from .maps.coverage import (
    NEAR_M,
    NEAR_NOISY_M,
    alignment,
    began,
    closed_contours,
    coverage,
    coverage_curve,
    own_alignment,
    sample,
)
from .maps.swept import soon, swept
from .own_gauge import OwnGauge, own_gauge
from .records import Log, Sketch

EXIT_STATUS = {Outcome.FAILED: 1, Outcome.INTERRUPTED: 130}
"""What the command ends in; 0 for every other outcome."""
TIMED = ("step_ms", "planning_ms")
"""The keys that differ between two runs of the same command."""


@dataclass(frozen=True)
class Ending:
    """How a run ended."""

    outcome: Outcome
    reason: str
    traceback: str = ""

    @property
    def status(self) -> str:
        """`complete`, `stopped` or `failed`."""
        return self.outcome.status

    @property
    def exit_status(self) -> int:
        """What the command ends in."""
        return EXIT_STATUS.get(self.outcome, 0)


def pose_nees(log: Log) -> Float[np.ndarray, " s"]:
    """Return the NEES of the invariant pose error at each step; NaN where a covariance is not positive definite."""
    return nees_of_poses(log.estimated_world, log.estimated_cov, log.true_world)


def pose_nees_from_start(log: Log) -> Float[np.ndarray, " s"]:
    """Return the NEES at each step of the pose relative to the start; NaN where there is none."""
    known = np.isfinite(log.from_start_cov).all(axis=(1, 2))
    values = np.full(len(log), np.nan)
    if known.any():
        values[known] = nees_of_poses(log.from_start_world[known], log.from_start_cov[known], log.true_world[known])
    return values


def nees_of_poses(
    estimated_world: Float[np.ndarray, "s 3"],
    estimated_cov: Float[np.ndarray, "s 3 3"],
    true_world: Float[np.ndarray, "s 3"],
) -> Float[np.ndarray, " s"]:
    """Return the NEES of invariant pose errors (m, m, rad); NaN where a covariance is not positive definite."""
    errors = pose_errors(estimated_world, true_world)
    covs = pose_covariances(estimated_world, estimated_cov)
    try:
        return nees(errors, covs)
    except np.linalg.LinAlgError:
        if len(errors) == 1:
            return np.array([np.nan])
        rows = zip(estimated_world[:, None], estimated_cov[:, None], true_world[:, None], strict=True)
        return np.concatenate([nees_of_poses(*row) for row in rows])


def odometry_path(log: Log) -> Float[np.ndarray, "s 3"]:
    """Return the path of the odometry alone, from the true start."""
    return odometry_poses(log.true_world[0], log.odometry)


def odometry_poses(start_world: Float[np.ndarray, "3"], odometry: Float[np.ndarray, "s 3"]) -> Float[np.ndarray, "s 3"]:
    """Return the poses from a start by the odometry alone; the first motion ends at the start."""
    poses = [start_world]
    for motion in odometry[1:]:
        poses.append(compose(poses[-1], motion))
    return np.array(poses)


def run_keys(scenario: Scenario, ending: Ending) -> dict[str, Any]:
    """Return the keys of summary.json that say which run it was and how it ended."""
    config = scenario.config
    return {
        "world": scenario.world.name,
        "backend": config.backend,
        "strategy": config.strategy,
        "seed": config.seed,
        "p0": config.p0,
        "errorless": config.errorless,
        "status": ending.status,
        "reason": ending.reason,
        "outcome": str(ending.outcome),
    }


def summarise(
    scenario: Scenario,
    log: Log,
    votes: Votes,
    step: Step,
    joint: Joint | None,
    ending: Ending,
    sketches: Sequence[Sketch],
) -> dict[str, Any]:
    """Return every key of summary.json; null where there is nothing to measure."""
    config = scenario.config
    return {
        **run_keys(scenario, ending),
        "steps": len(log),
        "path_length_m": float(log.path_length_m[-1]),
        "path_length_true_m": scenario.robot.record.path_length_m,
        "drive_time_s": scenario.robot.record.drive_time_s,
        "collisions": scenario.robot.record.collisions,
        "return_to_start": _return(log, config.mission.homing.home_m) if config.mission.return_to_start else None,
        "open_ends": int(log.open_ends[-1]),
        "set_aside": [
            {"wall": int(end.wall), "side": int(end.side), "position_m": end.position_world.tolist(), "why": end.reason}
            for end in step.set_aside
        ],
        **_map_scores(scenario, log, votes, step, joint, sketches),
        **_pose_scores(log, config.errorless),
        **innovation_scores(log),
        **range_scores(step, log),
        "step_ms": spread_ms(log.seconds),
        "planning_ms": spread_ms(log.planning_seconds),
    }


def range_scores(step: Step, log: Log) -> dict[str, Any]:
    """Return the calibration of the ranges, and the shares of beams on the robot's own body and on curves."""
    errors, returns = step.range_errors, np.count_nonzero(np.isfinite(log.ranges_m[:SCANS]))
    return {
        "range_bias_m": errors.bias_m,
        "range_bias_sigma_m": errors.bias_sigma_m,
        "range_scale": errors.scale,
        "range_scale_sigma": errors.scale_sigma,
        "own_beams": int(log.own_beams.sum()),
        "curved_share": float(log.curved_beams[:SCANS].sum() / returns) if returns else None,
    }


def _return(log: Log, home_m: float) -> dict[str, Any]:
    """Return the distance from the start at the end, m: estimated and true."""
    believed, true = (float(np.hypot(*(p[-1] - p[0])[:2])) for p in (log.estimated_world, log.true_world))
    return {"reached": believed <= home_m, "distance_m": believed, "distance_true_m": true}


def _pose_scores(log: Log, errorless: bool) -> dict[str, Any]:
    off = log.estimated_world - log.true_world
    wheels = np.hypot(*(odometry_path(log) - log.true_world)[:, :2].T)
    scores: dict[str, Any] = {
        "pose_rmse_m": float(np.sqrt(np.mean(np.sum(off[:, :2] ** 2, axis=1)))),
        "heading_rmse_rad": float(np.sqrt(np.mean(wrap(off[:, 2]) ** 2))),
        "odometry_rmse_m": float(np.sqrt(np.mean(wheels**2))),
        "odometry_max_m": float(wheels.max()),
        "odometry_end_m": float(wheels[-1]),
        "pose_anees": None,
        "pose_nees_in_band": None,
        "pose_anees_from_start": None,
    }
    values, relative = pose_nees(log), pose_nees_from_start(log)
    if not errorless and np.all(np.isfinite(values)):
        scores |= {"pose_anees": anees(values, 3), "pose_nees_in_band": share_in_band(values, 3)}
    if not errorless and np.all(np.isfinite(relative)):
        scores["pose_anees_from_start"] = anees(relative, 3)
    return scores


def _map_scores(
    scenario: Scenario, log: Log, votes: Votes, step: Step, joint: Joint | None, sketches: Sequence[Sketch]
) -> dict[str, Any]:
    truth, walls = votes.truth, step.map
    errorless = scenario.config.errorless
    near = NEAR_M if errorless else NEAR_NOISY_M
    to_true = alignment(scenario.start_estimate, log.true_world[0])
    began_at = began(log.lines)
    own = own_alignment(scenario.start_estimate, log.estimated_world, log.true_world, began_at)
    samples = sample(truth)
    aligned = to_world(walls.ends_world, to_true)
    labels = votes.walls_of(walls.ids)
    established = ~walls.tentative
    labelled = established & (labels >= 0)
    straight = map_error(votes, walls.ids, joint, labelled & ~walls.crooked)
    seen = swept(scenario.world, scenario.config.robot, log.true_world, log.bearings_rad, log.ranges_m)
    return {
        "lines": len(walls),
        "lines_tentative": int(np.count_nonzero(~established)),
        "lines_crooked": int(np.count_nonzero(walls.crooked)),
        "lines_unlabelled": int(np.count_nonzero(established & (labels < 0))),
        "contours_closed": len(closed_contours(samples, walls, step.chains, votes, own, near)),
        "contours_reachable": truth.contour.contours,
        "chains_closed": int(log.closed_chains[-1]),
        "chains_open": len(step.chains) - int(log.closed_chains[-1]),
        "coverage": coverage(samples, aligned[established], near),
        "coverage_own_frame": coverage(samples, to_world(walls.ends_world[established], own), near),
        "coverage_curve": coverage_curve(samples, sketches, to_true, near),
        "map_began_step": began_at,
        "swept": float(seen[-1]),
        **soon(seen, log.time_s, log.path_length_m),
        **map_scores(None if errorless else map_error(votes, walls.ids, joint, labelled)),
        "map_anees_straight": None if errorless or straight is None else straight.anees,
        "duplicate_lines": duplicate_lines(walls, labels, established),
        "false_matches": votes.false_matches(),
        "false_matches_few_beams": votes.false_matches_few_beams(),
        "merges": votes.merges,
        "false_merges": votes.false_merges,
        "distances": label_distances(corners(walls, step.chains), scenario.world.labels, to_true, joint),
    }


def map_error(
    votes: Votes, ids: Int[np.ndarray, " n"], joint: Joint | None, among: Bool[np.ndarray, " n"]
) -> OwnGauge | None:
    """Return the error of the chosen walls after gauge alignment; None if it cannot be computed.

    Each wall is compared with the true face from which most of its beams came. Duplicates are kept, and a covariance
    that is not positive definite gives None instead of a pseudo-inverse.
    """
    rows = np.flatnonzero(among)
    if joint is None or not len(rows):
        return None
    walls, lines = joint.take(rows), votes.truth.lines[np.maximum(votes.faces_of(ids[rows]), 0)]
    try:
        return own_gauge(walls.mean[POSE:].reshape(-1, 2), walls.cov[POSE:, POSE:], walls.anchors, lines)
    except np.linalg.LinAlgError:
        return None


def map_scores(error: OwnGauge | None) -> dict[str, float | None]:
    """Return what `summary.json` says of a map's error: of its shape, and of where its frame lies."""
    if error is None:
        return dict.fromkeys(("map_anees", "map_frame_anees", "map_frame_m", "map_frame_rad"))
    return {
        "map_anees": error.anees,
        "map_frame_anees": error.frame_squared / POSE,
        "map_frame_m": error.shift_m,
        "map_frame_rad": abs(float(error.frame_world[2])),
    }


def joint_anees(
    votes: Votes,
    ids: Int[np.ndarray, " n"],
    joint: Joint | None,
    true_pose_world: Float[np.ndarray, "3"],
    among: Bool[np.ndarray, " n"],
) -> float | None:
    """Return the NEES of the pose and the chosen walls together over its dimension, in the invariant error; or None."""
    rows = np.flatnonzero(among)
    if joint is None or not len(rows):
        return None
    lines = votes.truth.lines[np.maximum(votes.faces_of(ids[rows]), 0)]
    error, cov = joint_error(joint.take(rows), true_pose_world, lines)
    try:
        return float(nees(error[None], cov[None])[0]) / len(error)
    except np.linalg.LinAlgError:
        return None


def spread_ms(seconds: Float[np.ndarray, " s"]) -> dict[str, float]:
    """Return mean, median, 95th percentile and largest of some times, ms."""
    ms = 1e3 * seconds
    return {
        "mean": float(ms.mean()),
        "p50": float(np.percentile(ms, 50)),
        "p95": float(np.percentile(ms, 95)),
        "max": float(ms.max()),
    }
