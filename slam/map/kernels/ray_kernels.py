"""What beams say about walls: the loop of `ray_evidence`."""

import math

import numpy as np
from jaxtyping import Bool, Float

from ...geometry.compiled import compiled
from ...geometry.line_kernels import GRAZING, lines_from


@compiled
def ray_evidence(
    bearings_rad: Float[np.ndarray, " k"],
    ranges_m: Float[np.ndarray, " k"],
    passed_m: Float[np.ndarray, " k"],
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    margin_m: float,
) -> tuple[Float[np.ndarray, "n k"], Bool[np.ndarray, "n k"], Bool[np.ndarray, "n k"]]:
    """Return where beams cross lines (NaN where they do not), which end on them, and which go on beyond them."""
    n, k = len(means), len(bearings_rad)
    along, hits, passes = np.full((n, k), np.nan), np.zeros((n, k), np.bool_), np.zeros((n, k), np.bool_)
    x, y = np.cos(bearings_rad), np.sin(bearings_rad)
    lines, feet = lines_from(pose_world, anchors, means)
    for line in range(n):
        nx, ny, r = math.cos(lines[line, 0]), math.sin(lines[line, 0]), lines[line, 1]
        if r <= 0.0:
            continue
        for beam in range(k):
            cosine = x[beam] * nx + y[beam] * ny
            if cosine <= GRAZING:
                continue
            distance = r / cosine
            along[line, beam] = feet[line] + distance * (y[beam] * nx - x[beam] * ny)
            across = (passed_m[beam] - distance) * cosine
            hits[line, beam] = math.isfinite(ranges_m[beam]) and abs(across) <= margin_m
            passes[line, beam] = across > margin_m
    return along, hits, passes
