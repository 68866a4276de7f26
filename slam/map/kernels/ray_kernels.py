"""Where beams cross the lines of walls: the loop of `ray_evidence`."""

import math

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled
from ...geometry.line_kernels import GRAZING, lines_from


@compiled
def crossings(
    bearings_rad: Float[np.ndarray, " k"],
    passed_m: Float[np.ndarray, " k"],
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
) -> tuple[Float[np.ndarray, "n k"], Float[np.ndarray, "n k"]]:
    """Return where beams cross lines, and how far they go on beyond them, m across these; NaN where they do not."""
    along, across = np.full((2, len(means), len(bearings_rad)), np.nan)
    x, y = np.cos(bearings_rad), np.sin(bearings_rad)
    lines, feet = lines_from(pose_world, anchors, means)
    for line in range(len(lines)):
        nx, ny, r = math.cos(lines[line, 0]), math.sin(lines[line, 0]), lines[line, 1]
        if r <= 0.0:
            continue
        for beam in range(len(x)):
            cosine = x[beam] * nx + y[beam] * ny
            if cosine > GRAZING:
                distance = r / cosine
                along[line, beam] = feet[line] + distance * (y[beam] * nx - x[beam] * ny)
                across[line, beam] = (passed_m[beam] - distance) * cosine
    return along, across


@compiled
def reaching(
    along: Float[np.ndarray, "n k"],
    across: Float[np.ndarray, "n k"],
    extents: Float[np.ndarray, "n 2"],
    margin_m: float,
) -> Int[np.ndarray, " n"]:
    """Return how many beams reach each wall between its ends: they end on it, or go on beyond it."""
    count = np.zeros(len(extents), np.int64)
    for n in range(len(extents)):
        for beam in range(along.shape[1]):
            count[n] += across[n, beam] >= -margin_m and extents[n, 0] < along[n, beam] < extents[n, 1]
    return count
