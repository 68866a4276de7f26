"""The place of a submap on an older one: all places and turns of a window are tried, and the best has its rivals."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ...geometry.poses import rotation, wrap
from ...odometry.field_kernels import field_of
from ...odometry.search_kernels import refine
from .config import ClosuresConfig
from .correlation_kernels import best_in_blocks, largest_ahead

BLOCK = 8
"""Cells on each side of a block of places that are ruled out together."""
FINE = 0.5
"""The best place is looked up anew on cells and with a kernel of this share."""


@dataclass(frozen=True)
class Window:
    """The poses that are tried: about a guess, world frame, by so much to each side."""

    guess: Float[np.ndarray, "3"]
    half_m: float
    half_rad: float


@dataclass(frozen=True)
class Place:
    """Where a submap fits an older one."""

    pose: Float[np.ndarray, "3"]
    score: float
    """Mean likelihood of its points; 1 is a perfect fit."""
    rival: float
    """That of the best place apart from it, 0 where none comes near it."""


def apart(
    poses: Float[np.ndarray, "m 3"], of: Float[np.ndarray, "3"], config: ClosuresConfig
) -> Bool[np.ndarray, " m"]:
    """Return which poses are other places than one."""
    off = poses - of
    return (np.hypot(*off[:, :2].T) > config.apart_m) | (np.abs(wrap(off[:, 2])) > config.apart_rad)


def place_on(
    surface_world: Float[np.ndarray, "m 2"], points: Float[np.ndarray, "n 2"], window: Window, config: ClosuresConfig
) -> Place | None:
    """Return the place of a window that lays points, robot frame, best on old surfaces; None where none does."""
    c = config
    far = float(np.hypot(*points.T).max())
    field = field_of(surface_world, window.guess[:2], far + window.half_m, c.cell_m, c.cell_m, 2)
    turns = int(np.ceil(window.half_rad / c.step_rad))
    angles = window.guess[2] + np.arange(-turns, turns + 1) * c.step_rad
    turned = np.array([points @ rotation(angle).T for angle in angles]) + window.guess[:2]
    at = np.rint((turned - field.corner) / c.cell_m).astype(np.int32)
    values = field.values.astype(np.float32)
    found = best_in_blocks(
        values, largest_ahead(values, BLOCK), np.ascontiguousarray(at[..., 1]), np.ascontiguousarray(at[..., 0]),
        int(np.ceil(window.half_m / c.cell_m)), BLOCK, c.rival * c.least, c.rival,
    )  # fmt: skip
    if not len(found):
        return None
    moved = window.guess[:2] + c.cell_m * found[:, :0:-1][:, :2]
    poses = np.column_stack([moved, angles[found[:, 1].astype(np.int64)]])
    best = int(np.argmax(found[:, 0]))
    rival = float(found[apart(poses, poses[best], c), 0].max(initial=0.0))
    fine = field_of(surface_world, poses[best, :2], far, FINE * c.cell_m, FINE * c.cell_m, 4)
    pose, _ = refine(fine, points, poses[best], 0.5 * c.step_rad, 0.1 * c.cell_m)
    return Place(pose, float(found[best, 0]), rival)
