"""Loops over kept scans: the walls nearest to each, and where those have carried it."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.compiled import compiled


@compiled
def nearest(
    distances_m: Float[np.ndarray, "k n"], is_out: Bool[np.ndarray, " n"], count: int
) -> Int[np.ndarray, "k count"]:
    """Return the columns of the `count` least of each row, the least first, but for those that are out; -1 for none.

    Of equals the first comes first.
    """
    found = np.full((distances_m.shape[0], count), -1)
    for k in range(distances_m.shape[0]):
        filled = 0
        for n in range(distances_m.shape[1]):
            metres = distances_m[k, n]
            if is_out[n] or (filled == count and metres >= distances_m[k, found[k, count - 1]]):
                continue
            at = min(filled, count - 1)
            while at > 0 and metres < distances_m[k, found[k, at - 1]]:
                found[k, at] = found[k, at - 1]
                at -= 1
            found[k, at] = n
            filled = min(filled + 1, count)
    return found


@compiled
def carried(
    poses_world: Float[np.ndarray, "k 3"],
    length_m: Float[np.ndarray, " k"],
    turn: Float[np.ndarray, " k"],
    normal: Float[np.ndarray, "k 2 2"],
    shift: Float[np.ndarray, "k 2"],
    faith_m: float,
) -> Float[np.ndarray, "k 3"]:
    """Return where walls carried scans by (normal + faith) s = shift + faith s', where s' is the motion of the scan
    before, as one with this one; the turn likewise. Angles are not wrapped.
    """
    moved = np.empty_like(poses_world)
    x, y, angle = 0.0, 0.0, 0.0
    for k in range(len(poses_world)):
        before = max(k - 1, 0)
        arm_x, arm_y = poses_world[k, 0] - poses_world[before, 0], poses_world[k, 1] - poses_world[before, 1]
        c, s = math.cos(angle), math.sin(angle)
        right_x = shift[k, 0] + faith_m * (x + c * arm_x - s * arm_y - arm_x)
        right_y = shift[k, 1] + faith_m * (y + s * arm_x + c * arm_y - arm_y)
        angle = (turn[k] + faith_m * angle) / (length_m[k] + faith_m)
        xx, xy, yy = normal[k, 0, 0] + faith_m, normal[k, 0, 1], normal[k, 1, 1] + faith_m
        determinant = xx * yy - xy * xy
        x, y = (yy * right_x - xy * right_y) / determinant, (xx * right_y - xy * right_x) / determinant
        moved[k] = poses_world[k, 0] + x, poses_world[k, 1] + y, poses_world[k, 2] + angle
    return moved
