"""What beams say about walls: the loop of `ray_evidence`."""

import math

import numpy as np
from jaxtyping import Bool, Float

from ...geometry.compiled import compiled
from ...geometry.line_kernels import GRAZING


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
    beams = _directions(bearings_rad, pose_world[2])
    for line in range(n):
        nx, ny = math.cos(means[line, 0]), math.sin(means[line, 0])
        x, y = anchors[line, 0] - pose_world[0], anchors[line, 1] - pose_world[1]
        r, foot = means[line, 1] + nx * x + ny * y, ny * x - nx * y
        if r <= 0.0:
            continue
        for beam in range(k):
            cosine = beams[beam, 0] * nx + beams[beam, 1] * ny
            if cosine <= GRAZING:
                continue
            distance = r / cosine
            along[line, beam] = foot + distance * (beams[beam, 1] * nx - beams[beam, 0] * ny)
            across = (passed_m[beam] - distance) * cosine
            hits[line, beam] = math.isfinite(ranges_m[beam]) and abs(across) <= margin_m
            passes[line, beam] = across > margin_m
    return along, hits, passes


@compiled
def _directions(bearings_rad: Float[np.ndarray, " k"], heading_rad: float) -> Float[np.ndarray, "k 2"]:
    beams = np.empty((len(bearings_rad), 2))
    for k in range(len(bearings_rad)):
        beams[k, 0], beams[k, 1] = math.cos(bearings_rad[k] + heading_rad), math.sin(bearings_rad[k] + heading_rad)
    return beams
