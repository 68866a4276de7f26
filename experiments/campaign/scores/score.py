"""The scores of one trial: its summary, its scores at equal path lengths, and small arrays over its steps."""

from dataclasses import dataclass
from itertools import combinations
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.slam.estimation.backend import Joint
from chainslam.slam.evaluation.consistency import bound_margins
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import J, to_world, wrap
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

from ...scoring.association import Votes, duplicate_lines
from ...scoring.maps.corners import corners
from ...scoring.maps.coverage import NEAR_NOISY_M, Samples, alignment, coverage, sample
from ...scoring.maps.measurements import corner_points, distances
from ...scoring.records import Log
from ...scoring.summary import joint_anees, map_error, pose_nees, pose_nees_from_start
from ...scoring.trajectories import ate, position_errors, rpe
from ...trial import TrialResult
from .innovation import InnovationEar
from .observer import Moment, Observer, association_counts

END = "end"
ROUNDING = 1e-6
"""A trace or a bound that is exceeded by less than this share of the initial trace is not counted."""
RPE_STEPS = 10


@dataclass(frozen=True)
class TrialScores:
    """The record of one trial."""

    summary: dict[str, Any]
    """The keys of summary.json and those of the campaign; plain values, and `marks`, a row for each mark."""
    arrays: dict[str, np.ndarray]
    """Empty if the trial ended before its first step."""


def record_of(result: TrialResult, observer: Observer, ear: InnovationEar | None) -> TrialScores:
    """Score a trial that was observed."""
    # The curve is one of the arrays of a campaign, all of whose trials are scored like noisy ones.
    summary = {key: value for key, value in result.summary.items() if key != "coverage_curve"}
    log, last = result.log, result.last
    if log is None or last is None:
        return TrialScores(summary, {})
    to_true = alignment(result.scenario.start_estimate, log.true_world[0])
    samples = sample(result.votes.truth)
    # The estimate is moved by the initial pose error, which is unobservable, as in all scores of positions.
    end = Moment(len(log) - 1, float(log.path_length_m[-1]), last.map, result.joint)
    scorer = _Scorer(log, result.votes, samples, to_true, pose_nees(log))
    summary["marks"] = {
        **{f"{mark:g}": scorer.at(moment) for mark, moment in sorted(observer.marks.items())},
        END: scorer.at(end),
    }
    shift, turn = rpe(log.estimated_world, log.true_world, RPE_STEPS) if len(log) > RPE_STEPS else (None, None)
    summary |= {
        **_bound_scores(log, result.scenario.start_cov),
        "ate_m": ate(log.estimated_world, log.true_world),
        "ate_aligned_m": ate(log.estimated_world, log.true_world, align=True),
        "rpe_m": shift,
        "rpe_rad": turn,
        **{key: summary["marks"][END][key] for key in ("wall_rmse_m", "wall_shape_m", "joint_anees")},
        **association_counts(observer.fates, result.votes),
        "nis_mean": None,
        "nis_whiteness": None,
    }
    arrays = _step_arrays(log, scorer.nees) | _map_arrays(last.map, last.chains, log, to_true)
    arrays |= _distance_arrays(last.map, last.chains, result.votes, result.joint, to_true)
    # The last sample is the end itself, so that the curve ends where the run does.
    moments = [moment for moment in observer.moments if moment.index < end.index] + [end]
    arrays["coverage_path_m"] = np.array([moment.path_length_m for moment in moments])
    arrays["coverage"] = np.array([scorer.coverage(moment) for moment in moments])
    if ear is not None and ear.values:
        arrays |= {"nis": np.array(ear.values), "nis_dof": np.array(ear.dofs)}
        summary["nis_mean"] = ear.mean()
        summary["nis_whiteness"] = ear.whiteness()
    return TrialScores(summary, arrays)


def _bound_scores(log: Log, start_cov: Float[np.ndarray, "3 3"]) -> dict[str, float | None]:
    """Return how far the stated covariance falls below that of the start, and below the bound; None if it is unstated.

    docs/concepts/consistency.md, "The bound".
    """
    names = ("trace_least", "trace_below", "bound_margin", "bound_first_m", "bound_worst_m")
    traces = np.trace(log.estimated_cov, axis1=1, axis2=2)
    if not np.all(np.isfinite(traces)):
        return dict.fromkeys(names)
    margins = bound_margins(log.estimated_world, log.estimated_cov, start_cov)
    below = np.flatnonzero(margins < -ROUNDING)
    values = (
        float(traces.min() / np.trace(start_cov)),
        float(np.mean(traces < (1.0 - ROUNDING) * np.trace(start_cov))),
        float(margins.min()),
        float(log.path_length_m[below[0]]) if len(below) else None,
        float(log.path_length_m[margins.argmin()]) if len(below) else None,
    )
    return dict(zip(names, values, strict=True))


@dataclass(frozen=True)
class _Scorer:
    """Scores moments of one run."""

    log: Log
    votes: Votes
    samples: Samples
    to_true: Float[np.ndarray, "3"]
    nees: Float[np.ndarray, " s"]

    def coverage(self, moment: Moment) -> float:
        established = ~moment.map.tentative
        return coverage(self.samples, to_world(moment.map.ends_world[established], self.to_true), NEAR_NOISY_M)

    def at(self, moment: Moment) -> dict[str, Any]:
        """Return the row of one mark."""
        k, walls, log = moment.index, moment.map, self.log
        established, labels = ~walls.tentative, self.votes.walls_of(walls.ids)
        among, true_pose = established & (labels >= 0), log.true_world[k]
        off, shape = wall_errors(walls, self.votes, among, self.to_true)
        error = map_error(self.votes, walls.ids, moment.joint, among)
        return {
            "step": k,
            "path_length_m": moment.path_length_m,
            "pose_error_m": float(position_errors(log.estimated_world[k : k + 1], log.true_world[k : k + 1])[0]),
            "heading_error_rad": float(abs(wrap(log.estimated_world[k, 2] - true_pose[2]))),
            "pose_nees": _or_none(self.nees[k]),
            "pose_anees_so_far": _or_none(np.mean(self.nees[: k + 1]) / 3.0),
            "pose_trace": _or_none(np.trace(log.estimated_cov[k])),
            "coverage": self.coverage(moment),
            "wall_rmse_m": off,
            "wall_shape_m": shape,
            "map_anees": None if error is None else error.anees,
            "joint_anees": joint_anees(self.votes, walls.ids, moment.joint, true_pose, among),
            "lines": len(walls),
            "duplicate_lines": duplicate_lines(walls, labels, established),
        }


def _or_none(value: float) -> float | None:
    return float(value) if np.isfinite(value) else None


def wall_errors(
    walls: StochasticMap, votes: Votes, among: np.ndarray, to_true: Float[np.ndarray, "3"]
) -> tuple[float | None, float | None]:
    """Return how far the ends of mapped walls lie from the lines of their true walls, rms, m; None without a wall.

    First as the map lies, then after the small shift and turn of the whole map that make it least: its shape alone.
    """
    if not among.any():
        return None, None
    lines = votes.truth.lines[votes.faces_of(walls.ids[among])]
    ends = to_world(walls.ends_world[among], to_true)
    return offsets(ends, lines)


def offsets(points: Float[np.ndarray, "m k 2"], lines: Float[np.ndarray, "m 2"]) -> tuple[float, float]:
    """Return the rms distance of points from one line each, m, before and after the best small rigid motion."""
    n = np.repeat(normals(lines[:, 0]), points.shape[1], axis=0)
    flat = points.reshape(-1, 2)
    across = np.sum(flat * n, axis=1) - np.repeat(lines[:, 1], points.shape[1])
    by_motion = np.column_stack([n, np.sum(n * (flat @ J.T), axis=1)])
    rest = across - by_motion @ np.linalg.lstsq(by_motion, across, rcond=None)[0]
    return float(np.sqrt(np.mean(across**2))), float(np.sqrt(np.mean(rest**2)))


def _step_arrays(log: Log, nees: Float[np.ndarray, " s"]) -> dict[str, np.ndarray]:
    return {
        "path_length_m": log.path_length_m,
        "pose_nees": nees,
        "pose_nees_from_start": pose_nees_from_start(log),
        "pose_trace": np.trace(log.estimated_cov, axis1=1, axis2=2),
        "pose_error_m": position_errors(log.estimated_world, log.true_world),
        "heading_error_rad": np.abs(wrap(log.estimated_world[:, 2] - log.true_world[:, 2])),
        "heading_sigma_rad": np.sqrt(log.estimated_cov[:, 2, 2]),
        "lines": log.lines,
    }


def _map_arrays(
    walls: StochasticMap, chains: tuple[Chain, ...], log: Log, to_true: Float[np.ndarray, "3"]
) -> dict[str, np.ndarray]:
    """Return the final map and the path, moved by the initial pose error, for pictures with the truth."""
    closed = {wall for chain in chains if chain.is_closed for wall in chain.walls}
    return {
        "map_ends": to_world(walls.ends_world, to_true),
        "map_closed": np.isin(walls.ids, sorted(closed)),
        "map_tentative": walls.tentative.copy(),
        "path_estimated": to_world(log.estimated_world[:, :2], to_true),
        "path_true": log.true_world[:, :2],
    }


def _distance_arrays(
    walls: StochasticMap,
    chains: tuple[Chain, ...],
    votes: Votes,
    joint: Joint | None,
    to_true: Float[np.ndarray, "3"],
) -> dict[str, np.ndarray]:
    """Return all distances between mapped corners with a known true value: mapped, sigma, true, m."""
    found = [corner for corner in corners(walls, chains) if corner.jacobian is not None]
    places = _true_corners(votes)
    rows, true = [], []
    for row, corner in enumerate(found):
        candidates = places.get(tuple(votes.walls_of(np.array(corner.walls)).tolist()))
        if candidates is not None:
            at = to_world(corner.position_world[None], to_true)[0]
            rows.append(row)
            true.append(candidates[np.argmin(np.hypot(*(candidates - at).T))])
    pairs = np.array(list(combinations(range(len(rows)), 2)), dtype=np.int64).reshape(-1, 2)
    if joint is None or not len(pairs):
        return {name: np.zeros(0) for name in ("distance_m", "distance_sigma_m", "distance_true_m")}
    jacobians = np.array([found[row].jacobian for row in rows])
    points = corner_points(np.array([found[row].position_world for row in rows]), jacobians, joint.cov)
    value, sigma = distances(points, pairs)
    between = np.array(true)[pairs]
    lengths = np.hypot(*(between[:, 1] - between[:, 0]).T)
    known = lengths > 0.0
    return {"distance_m": value[known], "distance_sigma_m": sigma[known], "distance_true_m": lengths[known]}


def _true_corners(votes: Votes) -> dict[tuple[int, ...], Float[np.ndarray, "c 2"]]:
    """Return the corners of true walls by pair of walls, with the free side on the left."""
    faces, walls = votes.truth.faces, votes.truth.walls
    begins = {_key(face[0]): row for row, face in enumerate(faces)}
    places: dict[tuple[int, ...], list[np.ndarray]] = {}
    for row, face in enumerate(faces):
        after = begins.get(_key(face[1]))
        if after is not None and walls[after] != walls[row]:
            places.setdefault((int(walls[row]), int(walls[after])), []).append(face[1])
    return {pair: np.array(at) for pair, at in places.items()}


def _key(point: Float[np.ndarray, "2"]) -> tuple[int, ...]:
    return tuple(np.round(1e6 * point).astype(int).tolist())
