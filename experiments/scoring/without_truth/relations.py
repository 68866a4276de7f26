"""Errors of a path against measured relations between its poses, which need no common frame and no alignment.

The measure of Kuemmerle et al., "On Measuring the Accuracy of SLAM Algorithms", Autonomous Robots 27 (2009).
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.poses import wrap

SAME_TIME_S = 0.01
"""Times closer than this belong to one scan, unless scans were written closer together."""
FAR_S = 60.0
"""Relations over a longer time measure the global consistency of a map; shorter ones measure the odometry."""


@dataclass(frozen=True)
class Relations:
    """Poses relative to earlier poses of the same robot; m relations."""

    first_s: Float[np.ndarray, " m"]
    second_s: Float[np.ndarray, " m"]
    motions: Float[np.ndarray, "m p"]
    """The second pose in the frame of the first, m m rad; in space x y z qx qy qz qw."""

    def take(self, rows: Bool[np.ndarray, " m"] | Int[np.ndarray, " k"]) -> "Relations":
        """Return the chosen ones."""
        return Relations(self.first_s[rows], self.second_s[rows], self.motions[rows])

    @property
    def far(self) -> Bool[np.ndarray, " m"]:
        """Whether the two times are at least a minute apart."""
        return np.abs(self.second_s - self.first_s) >= FAR_S

    def within(self, low_s: float, high_s: float) -> "Relations":
        """Return those with both times in an interval."""
        times = np.stack([self.first_s, self.second_s])
        return self.take(np.all((times >= low_s) & (times <= high_s), axis=0))


def between(first: Float[np.ndarray, "m 3"], second: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m 3"]:
    """Return each second pose in the frame of the first one beside it."""
    c, s = np.cos(first[:, 2]), np.sin(first[:, 2])
    dx, dy = (second - first)[:, :2].T
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, wrap(second[:, 2] - first[:, 2])])


def same_scan_s(scan_time_s: Float[np.ndarray, " s"]) -> float:
    """Return how close two times of one scan are: 10 ms, or half the smallest gap between scans if that is less.

    A computer that was busy stamps several scans within a millisecond or two, and a log may hold only some of them:
    the nearest scan is then another one, taken elsewhere.
    """
    gaps = np.diff(np.unique(scan_time_s))
    return min(SAME_TIME_S, 0.5 * float(gaps.min(initial=2.0 * SAME_TIME_S)))


def nearest_rows(
    time_s: Float[np.ndarray, " s"], asked_s: Float[np.ndarray, " m"], within_s: float = SAME_TIME_S
) -> tuple[Int[np.ndarray, " m"], Bool[np.ndarray, " m"]]:
    """Return the row of the nearest time to each requested one, and whether it is so near; times ascend."""
    after = np.clip(np.searchsorted(time_s, asked_s), 0, len(time_s) - 1)
    before = np.maximum(after - 1, 0)
    rows = np.where(np.abs(time_s[before] - asked_s) <= np.abs(time_s[after] - asked_s), before, after)
    return rows, np.abs(time_s[rows] - asked_s) <= within_s


def interpolated(
    time_s: Float[np.ndarray, " s"], poses_world: Float[np.ndarray, "s 3"], asked_s: Float[np.ndarray, " m"]
) -> Float[np.ndarray, "m 3"]:
    """Return poses between those of a path, at even speed and turn; at its ends where the time lies beyond."""
    turns = np.unwrap(poses_world[:, 2])
    columns = (np.interp(asked_s, time_s, values) for values in (*poses_world[:, :2].T, turns))
    x, y, heading = columns
    return np.column_stack([x, y, wrap(heading)])


def relation_errors(
    first_world: Float[np.ndarray, "m 3"], second_world: Float[np.ndarray, "m 3"], motions: Float[np.ndarray, "m 3"]
) -> Float[np.ndarray, "m 2"]:
    """Return the size m and the angle rad of the difference between a measured relation and that of the path."""
    left = between(motions, between(first_world, second_world))
    return np.column_stack([np.hypot(*left[:, :2].T), np.abs(left[:, 2])])


def errors_at_scans(
    time_s: Float[np.ndarray, " s"], poses_world: Float[np.ndarray, "s 3"], relations: Relations
) -> tuple[Relations, Float[np.ndarray, "k 2"]]:
    """Return the relations whose times are both those of scans, as `same_scan_s` has it, and their errors (m, rad).

    The path has a pose for each scan of the log.
    """
    within_s = same_scan_s(time_s)
    both = np.all([nearest_rows(time_s, each, within_s)[1] for each in (relations.first_s, relations.second_s)], axis=0)
    return errors_between_scans(time_s, poses_world, relations.take(both), within_s)


def errors_between_scans(
    time_s: Float[np.ndarray, " s"], poses_world: Float[np.ndarray, "s 3"], relations: Relations, beyond_s: float = 0.0
) -> tuple[Relations, Float[np.ndarray, "k 2"]]:
    """Return the relations within the time span of the path, and their errors (m, rad), with interpolated poses.

    The span begins `beyond_s` before its first pose and ends as long after its last one.
    """
    chosen = relations.within(float(time_s[0]) - beyond_s, float(time_s[-1]) + beyond_s)
    first, second = (interpolated(time_s, poses_world, asked) for asked in (chosen.first_s, chosen.second_s))
    return chosen, relation_errors(first, second, chosen.motions)


def paired_poses(
    time_s: Float[np.ndarray, " s"],
    poses_world: Float[np.ndarray, "s 3"],
    reference_s: Float[np.ndarray, " r"],
    reference_world: Float[np.ndarray, "r 3"],
) -> tuple[Float[np.ndarray, "k 3"], Float[np.ndarray, "k 3"]]:
    """Return the poses of a path and of a reference at the same times, to 10 ms; each of the shorter one once."""
    if len(reference_s) <= len(time_s):
        rows, near = nearest_rows(time_s, reference_s)
        return poses_world[rows[near]], reference_world[near]
    rows, near = nearest_rows(reference_s, time_s)
    return poses_world[near], reference_world[rows[near]]
