"""Where a scan's points fit a likelihood field best: all places of a window, then ever finer steps from the best."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ..geometry.compiled import compiled
from .field_kernels import LikelihoodField, score


class Window(NamedTuple):
    """The poses that are tried about a guess."""

    guess: Float[np.ndarray, "3"]
    half_m: float
    half_rad: float
    step_rad: float
    precision: Float[np.ndarray, "3 3"]
    """Of the guess, in units of the score: a pose loses half the square of its distance by it."""


@compiled
def correlate(
    field: LikelihoodField, points_robot: Float[np.ndarray, "n 2"], window: Window
) -> tuple[Float[np.ndarray, "3"], float]:
    """Return the best pose of a window, to a cell and a step of the turn, and its mean likelihood."""
    reach = max(int(np.ceil(window.half_m / field.cell_m)), 1)
    turns = max(int(np.ceil(window.half_rad / window.step_rad)), 1)
    P = window.precision
    best, best_pose, likelihood = -np.inf, window.guess.copy(), 0.0
    for turn in range(-turns, turns + 1):
        z = turn * window.step_rad
        found = _shifted(field, points_robot, window.guess, z, reach)
        for dy in range(-reach, reach + 1):
            for dx in range(-reach, reach + 1):
                x, y = field.cell_m * dx, field.cell_m * dy
                off = P[0, 0] * x * x + P[1, 1] * y * y + P[2, 2] * z * z
                off += 2.0 * (P[0, 1] * x * y + P[0, 2] * x * z + P[1, 2] * y * z)
                value = found[dy + reach, dx + reach] - 0.5 * off
                if value > best:
                    best, likelihood = value, found[dy + reach, dx + reach]
                    best_pose[0], best_pose[1] = window.guess[0] + x, window.guess[1] + y
                    best_pose[2] = window.guess[2] + z
    return best_pose, likelihood


@compiled
def _shifted(
    field: LikelihoodField,
    points_robot: Float[np.ndarray, "n 2"],
    guess: Float[np.ndarray, "3"],
    turn: float,
    reach: int,
) -> Float[np.ndarray, "s s"]:
    """Return the mean likelihood from a turned guess, moved by -reach to reach cells along y (rows) and x (columns)."""
    rows, columns = field.values.shape
    c, s = np.cos(guess[2] + turn), np.sin(guess[2] + turn)
    total = np.zeros((2 * reach + 1, 2 * reach + 1))
    for i in range(len(points_robot)):
        px, py = points_robot[i, 0], points_robot[i, 1]
        column = int(np.rint((c * px - s * py + guess[0] - field.corner[0]) / field.cell_m))
        row = int(np.rint((s * px + c * py + guess[1] - field.corner[1]) / field.cell_m))
        # A whole margin from the rim, so that every shift is within the grid.
        column = min(max(column, field.margin), columns - 1 - field.margin) - reach
        row = min(max(row, field.margin), rows - 1 - field.margin) - reach
        for j in range(2 * reach + 1):
            for k in range(2 * reach + 1):
                total[j, k] += field.values[row + j, column + k]
    return total / len(points_robot)


@compiled
def refine(
    field: LikelihoodField,
    points_robot: Float[np.ndarray, "n 2"],
    pose: Float[np.ndarray, "3"],
    step_rad: float,
    finest_m: float,
) -> tuple[Float[np.ndarray, "3"], float]:
    """Return the pose uphill from one, by steps that halve where none of six neighbours is better, and its score."""
    step = np.array([0.5 * field.cell_m, 0.5 * field.cell_m, 0.5 * step_rad])
    best = pose.copy()
    highest = score(field, points_robot, best[0], best[1], best[2])
    while step[0] >= finest_m:
        uphill, towards = highest, -1
        for k in range(6):
            tried = _moved(best, step, k)
            value = score(field, points_robot, tried[0], tried[1], tried[2])
            if value > uphill:
                uphill, towards = value, k
        if towards >= 0:
            best, highest = _moved(best, step, towards), uphill
        else:
            step *= 0.5
    best[2] = (best[2] + np.pi) % (2.0 * np.pi) - np.pi
    return best, highest


@compiled
def _moved(pose: Float[np.ndarray, "3"], step: Float[np.ndarray, "3"], k: int) -> Float[np.ndarray, "3"]:
    """Return the k-th of six neighbours of a pose: ahead along each axis, then back."""
    moved = pose.copy()
    moved[k % 3] += step[k % 3] if k < 3 else -step[k % 3]
    return moved
