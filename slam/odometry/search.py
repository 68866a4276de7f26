"""Where a scan's points fit a likelihood field best: all places of a window, then ever finer steps from the best."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from ..geometry.poses import wrap
from .likelihood_field import LikelihoodField

LARGEST = 2_000_000
"""Look-ups at a time."""


@dataclass(frozen=True)
class Window:
    """The poses that are tried about a guess."""

    guess: Float[np.ndarray, "3"]
    half_m: float
    half_rad: float
    step_rad: float
    penalty: float
    """What a pose at the rim loses, growing with the square of the distance from the guess."""


def placed(points_robot: Float[np.ndarray, "n 2"], poses: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "m n 2"]:
    """Return a scan's points as seen from each of some poses."""
    c, s = np.cos(poses[:, 2, None]), np.sin(poses[:, 2, None])
    x, y = points_robot.T
    return np.stack([c * x - s * y + poses[:, 0, None], s * x + c * y + poses[:, 1, None]], axis=-1)


def scores(
    field: LikelihoodField, points_robot: Float[np.ndarray, "n 2"], poses: Float[np.ndarray, "m 3"]
) -> Float[np.ndarray, " m"]:
    """Return the mean likelihood of a scan's points from each of some poses; 1 is a perfect fit."""
    return np.asarray(field.at(placed(points_robot, poses)).mean(axis=1))


def correlate(
    field: LikelihoodField, points_robot: Float[np.ndarray, "n 2"], window: Window
) -> tuple[Float[np.ndarray, "3"], float]:
    """Return the best pose of a window, to a cell and a step of the turn, and its mean likelihood."""
    reach = max(int(np.ceil(window.half_m / field.cell_m)), 1)
    turns = max(int(np.ceil(window.half_rad / window.step_rad)), 1)
    steps = np.arange(-reach, reach + 1)
    angles = np.arange(-turns, turns + 1) * window.step_rad
    dy, dx = (grid.ravel() for grid in np.meshgrid(steps, steps, indexing="ij"))
    shift = (dy * field.values.shape[1] + dx).astype(np.int32)
    poses = np.column_stack([np.tile(window.guess[:2], (len(angles), 1)), window.guess[2] + angles])
    rows, columns = field.cells(placed(points_robot, poses))
    first = (rows * field.values.shape[1] + columns).astype(np.int32)
    flat = field.values.ravel()
    at_once = max(LARGEST // (len(shift) * max(len(points_robot), 1)), 1)
    found = np.concatenate(
        [
            flat[first[k : k + at_once, None, :] + shift[:, None]].mean(axis=2)
            for k in range(0, len(angles), at_once)
        ]
    )  # fmt: skip
    far = (dx**2 + dy**2) / reach**2 + (np.arange(-turns, turns + 1) / turns)[:, None] ** 2
    turn, place = np.unravel_index(np.argmax(found - window.penalty * far), found.shape)
    off = np.array([field.cell_m * dx[place], field.cell_m * dy[place], angles[turn]])
    return window.guess + off, float(found[turn, place])


def refine(
    field: LikelihoodField,
    points_robot: Float[np.ndarray, "n 2"],
    pose: Float[np.ndarray, "3"],
    step_rad: float,
    finest_m: float,
) -> tuple[Float[np.ndarray, "3"], float]:
    """Return the pose uphill from one, by steps that halve where none of six neighbours is better, and its score."""
    step = np.array([0.5 * field.cell_m, 0.5 * field.cell_m, 0.5 * step_rad])
    best, score = pose, float(scores(field, points_robot, pose[None])[0])
    neighbours = np.concatenate([np.eye(3), -np.eye(3)])
    while step[0] >= finest_m:
        tried = best + neighbours * step
        found = scores(field, points_robot, tried)
        k = int(np.argmax(found))
        if found[k] > score:
            best, score = tried[k], float(found[k])
        else:
            step = 0.5 * step
    return np.array([best[0], best[1], wrap(best[2])]), score
