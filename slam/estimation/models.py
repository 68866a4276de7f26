"""Motion and line-measurement models with their Jacobians, shared by every back end.

A line is (alpha, d) about a constant anchor c, r = d + n(alpha)·c in the world frame; a pose is (p, theta). J is the
90-degree rotation and n' = J n. Jacobians are taken at the estimate, or where the caller says (`position`, `alpha`).
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from ..geometry.lines import directions, normals
from ..geometry.poses import J, rotation, wrap
from .kernels import innovation_rows, stacked, turn_halfway


@dataclass(frozen=True)
class Motion:
    """A predicted pose and how it depends on the pose before and on the odometry."""

    pose_world: Float[np.ndarray, "3"]
    F: Float[np.ndarray, "3 3"]
    """Derivative by the pose before."""
    W: Float[np.ndarray, "3 3"]
    """Derivative by the odometry's motion."""

    def noise(self, cov: Float[np.ndarray, "3 3"]) -> Float[np.ndarray, "3 3"]:
        """Return the covariance that odometry of this covariance adds to the pose's."""
        return self.W @ cov @ self.W.T


def move(
    pose_world: Float[np.ndarray, "3"],
    motion: Float[np.ndarray, "3"],
    position: Float[np.ndarray, "2"] | None = None,
) -> Motion:
    """Predict the pose after `motion` (robot frame); F is J (p+ - p) with p the estimate, or `position`."""
    R = rotation(pose_world[2])
    F, W = np.eye(3), np.eye(3)
    step = R @ motion[:2]
    moved = pose_world[:2] + step
    F[:2, 2] = J @ (step if position is None else moved - position)
    W[:2, :2] = R
    return Motion(np.array([moved[0], moved[1], wrap(pose_world[2] + motion[2])]), F, W)


def lines_robot(
    pose_world: Float[np.ndarray, "3"], anchors: Float[np.ndarray, "m 2"], means: Float[np.ndarray, "m 2"]
) -> Float[np.ndarray, "m 2"]:
    """Predict map lines as (alpha, r) in the robot frame."""
    alpha = means[:, 0]
    r = means[:, 1] + np.vecdot(normals(alpha), anchors - pose_world[:2])
    return np.stack([wrap(alpha - pose_world[2]), r], axis=-1)


@dataclass(frozen=True)
class Innovations:
    """How m seen lines differ from m map lines, along and across each line at its own seen piece."""

    e: Float[np.ndarray, "m 2"]
    """(angle rad, distance of the seen piece's centre from the predicted line m)."""
    H_pose: Float[np.ndarray, "m 2 3"]
    """Minus the derivative of e by the pose."""
    H_line: Float[np.ndarray, "m 2 2"]
    """Minus the derivative of e by the line."""
    R: Float[np.ndarray, "m 2 2"]
    """Covariance of e that comes from the measurement."""

    def take(self, rows: Int[np.ndarray, " k"] | Bool[np.ndarray, " m"]) -> "Innovations":
        """Return the chosen rows (integer or boolean index)."""
        return Innovations(self.e[rows], self.H_pose[rows], self.H_line[rows], self.R[rows])


def innovations(
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "m 2"],
    means: Float[np.ndarray, "m 2"],
    lines: Float[np.ndarray, "m 2"],
    cov: Float[np.ndarray, "m 2 2"],
    position: Float[np.ndarray, "2"] | None = None,
    alpha: Float[np.ndarray, " m"] | None = None,
) -> Innovations:
    """Compare seen lines (alpha, r) with their covariance, robot frame, to map lines, row by row.

    With epsilon the angle between the two and t0 = C_alpha_r / C_alpha_alpha the place of the piece's centre along
    the seen line, e = (epsilon, r cos(epsilon) - t0 sin(epsilon) - r_predicted): linear in r however far off to one
    side the piece lies, where the difference in (alpha, r) is not. The centre stays on its beam: an error in the
    seen direction turns the line about it, so the two parts of e are independent, and remain so where epsilon is large.

    e and R are those of the estimate; H is taken at the robot's `position` and the lines' directions `alpha` if given.
    """
    at, along = pose_world[:2] if position is None else position, means[:, 0] if alpha is None else alpha
    return Innovations(*innovation_rows(pose_world, anchors, means, lines, cov, at, np.ascontiguousarray(along)))


def halfway(
    model: Innovations,
    lines: Float[np.ndarray, "m 2"],
    cov: Float[np.ndarray, "m 2 2"],
    turn: Float[np.ndarray, " m"],
) -> Innovations:
    """Return the innovations of seen lines with H taken halfway to where the heading makes up for `turn` of epsilon.

    How far off a line lies is bent in the heading: after an odometry error of 5 degrees a wall 2 m away lies 7 mm
    off the tangent at the estimate, and 0.1 mm off this one.
    """
    H_pose, H_line = model.H_pose.copy(), model.H_line.copy()
    turn_halfway(model.e, H_pose, H_line, lines, cov, turn)
    return Innovations(model.e, H_pose, H_line, model.R)


@dataclass(frozen=True)
class Linear:
    """A linear measurement of the pose and a few lines: e = H dx + v, v of covariance R."""

    rows: Int[np.ndarray, " u"]
    """Rows of the map's lines that are measured, each once."""
    H: Float[np.ndarray, "k s"]
    """By the pose and those lines, s = 3 + 2 u."""
    e: Float[np.ndarray, " k"]
    R: Float[np.ndarray, "k k"]
    place: Int[np.ndarray, " m"] = field(default_factory=lambda: np.zeros(0, dtype=np.int64))
    """Where in `rows` the line of each observation stands; observation i has rows 2 i and 2 i + 1 of H, e and R. Empty
    for a measurement that is of no observation, as that two lines are one."""

    def before(self, step: Float[np.ndarray, " p"]) -> "Linear":
        """Return the measurement as one of the errors before a step of the first p parts of the state: e + H step."""
        return Linear(self.rows, self.H, self.e + self.H[:, : len(step)] @ step, self.R, self.place)


def stack(rows: Int[np.ndarray, " m"], model: Innovations) -> Linear:
    """Join the innovations of m observations (several may be of one line) into one measurement."""
    each = np.arange(len(rows))
    lines, place = (rows, each) if len(set(rows.tolist())) == len(rows) else np.unique(rows, return_inverse=True)
    H, R = stacked(place, len(lines), model.H_pose, model.H_line, model.R)
    return Linear(lines, H, model.e.ravel(), R, place)


@dataclass(frozen=True)
class Initialisation:
    """New map lines and how they depend on the pose and on the measurement."""

    anchors: Float[np.ndarray, "m 2"]
    means: Float[np.ndarray, "m 2"]
    G_pose: Float[np.ndarray, "m 2 3"]
    G_line: Float[np.ndarray, "m 2 2"]

    def noise(self, cov: Float[np.ndarray, "m 2 2"]) -> Float[np.ndarray, "m 2 2"]:
        """Return the covariance that each line has of a measurement of this covariance."""
        return self.G_line @ cov @ self.G_line.swapaxes(1, 2)


def initialise(
    pose_world: Float[np.ndarray, "3"],
    lines: Float[np.ndarray, "m 2"],
    centres: Float[np.ndarray, "m 2"],
    at_wall: bool = True,
    position: Float[np.ndarray, "2"] | None = None,
) -> Initialisation:
    """Turn seen lines (alpha, r), robot frame, into map lines, anchored at their seen centres or at the world's origin.

    Centres are points of the lines in the robot frame, m; the anchors that come of them are constants. The Jacobians
    are taken at the robot's `position` if given.
    """
    alpha = wrap(lines[:, 0] + pose_world[2])
    n, t = normals(alpha), directions(alpha)
    anchors = centres @ rotation(pose_world[2]).T + pose_world[:2] if at_wall else np.zeros_like(centres)
    to_robot = pose_world[:2] - anchors
    means = np.stack([alpha, lines[:, 1] + np.vecdot(n, to_robot)], axis=-1)
    lever = np.vecdot(t, to_robot if position is None else position - anchors)
    m = len(lines)
    G_pose, G_line = np.zeros((m, 2, 3)), np.zeros((m, 2, 2))
    G_pose[:, 0, 2] = 1.0
    G_pose[:, 1, :2] = n
    G_pose[:, 1, 2] = lever
    G_line[:, 0, 0] = 1.0
    G_line[:, 1, 0] = lever
    G_line[:, 1, 1] = 1.0
    return Initialisation(anchors, means, G_pose, G_line)


def reanchor(
    mean: Float[np.ndarray, "2"],
    anchor: Float[np.ndarray, "2"],
    other: Float[np.ndarray, "2"],
    alpha: float | None = None,
) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2 2"]]:
    """Express a line about another anchor and return it with the derivative of the change (at `alpha` if given)."""
    shift = anchor - other
    n, t = normals(mean[:1])[0], directions(mean[:1] if alpha is None else np.array([alpha]))[0]
    return np.array([mean[0], mean[1] + n @ shift]), np.array([[1.0, 0.0], [t @ shift, 1.0]])
