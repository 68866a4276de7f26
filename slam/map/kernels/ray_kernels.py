"""What beams say about walls, and about the ways between their ends: the loops of `ray_evidence` and `openings`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.line_kernels import GRAZING
from ...geometry.numerics import TINY
from .chain_kernels import HEAD, TAIL, near_ends, supposed_corners


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


@compiled
def passing(
    from_world: Float[np.ndarray, "g 2"],
    to_world: Float[np.ndarray, "g 2"],
    pose_world: Float[np.ndarray, "3"],
    bearings_rad: Float[np.ndarray, " k"],
    passed_m: Float[np.ndarray, " k"],
    beyond_m: float,
    margin_m: float,
    across_m: float,
) -> Bool[np.ndarray, "g k"]:
    """Return which beams cross the straight way between two points, away from both, and go on beyond it.

    So far along the beam, and so far across the way.
    """
    beams = _directions(bearings_rad, pose_world[2])
    through = np.zeros((len(from_world), len(bearings_rad)), np.bool_)
    for g in range(len(from_world)):
        _cross(from_world[g], to_world[g], pose_world, beams, passed_m, beyond_m, margin_m, across_m, through[g])
    return through


@compiled
def _cross(
    from_world: Float[np.ndarray, "2"],
    to_world: Float[np.ndarray, "2"],
    pose_world: Float[np.ndarray, "3"],
    beams: Float[np.ndarray, "k 2"],
    passed_m: Float[np.ndarray, " k"],
    beyond_m: float,
    margin_m: float,
    across_m: float,
    through: Bool[np.ndarray, " k"],
) -> None:
    """Note which beams, by their directions, cross one way as `passing` says; those noted before stay noted."""
    gap_x, gap_y = to_world[0] - from_world[0], to_world[1] - from_world[1]
    x, y = from_world[0] - pose_world[0], from_world[1] - pose_world[1]
    width = max(math.hypot(gap_x, gap_y), TINY)
    for k in range(len(beams)):
        # p + s beam = from + u gap; with J the quarter turn, x·(J y) = 0 for x parallel to y.
        denominator = gap_y * beams[k, 0] - gap_x * beams[k, 1]
        if abs(denominator) <= TINY:
            continue
        u = -(y * beams[k, 0] - x * beams[k, 1]) / denominator
        s = -(y * gap_x - x * gap_y) / denominator
        if not (margin_m / width < u < 1.0 - margin_m / width and s > 0.0):
            continue
        sine = max(abs(denominator) / width, TINY)
        through[k] |= passed_m[k] > s + beyond_m + across_m / sine


class Watch(NamedTuple):
    """The numbers of `SharedConfig` that the loops read."""

    widest_m: float
    corner_reach_m: float
    beyond_m: float
    margin_m: float
    beams: int


@compiled
def between(
    ends: Float[np.ndarray, "n 2 2"],
    lines: Float[np.ndarray, "n 2"],
    is_watched: Bool[np.ndarray, " n"],
    pose_world: Float[np.ndarray, "3"],
    bearings_rad: Float[np.ndarray, " k"],
    passed_m: Float[np.ndarray, " k"],
    range_m: float,
    watch: Watch,
) -> tuple[Int[np.ndarray, "p 2"], Bool[np.ndarray, " p"], Bool[np.ndarray, " p"], Bool[np.ndarray, " p"]]:
    """Return the pairs (head of one, tail of another) of walls that may bound a gap or make a corner.

    And which gaps beams have passed, which corners are supposed, and which of those beams have cut off.
    """
    rows = np.flatnonzero(is_watched)
    near = near_ends(ends[rows], watch.widest_m)
    pairs, count = np.empty((len(near), 2), np.int64), 0
    for k in range(len(near)):
        head, tail = rows[near[k, 0]], rows[near[k, 1]]
        if math.hypot(ends[head, HEAD, 0] - pose_world[0], ends[head, HEAD, 1] - pose_world[1]) < range_m:
            pairs[count, 0], pairs[count, 1] = head, tail
            count += 1
    pairs = pairs[:count].copy()
    corners, supposed = supposed_corners(pairs, ends, lines, watch.corner_reach_m, 2.0 * watch.margin_m)
    passed, cut_off = np.zeros(count, np.bool_), np.zeros(count, np.bool_)
    beams, margin_m = _directions(bearings_rad, pose_world[2]), watch.margin_m
    through = np.zeros(len(beams), np.bool_)
    for k in range(count):
        head, tail = ends[pairs[k, 0], HEAD], ends[pairs[k, 1], TAIL]
        if math.hypot(tail[0] - head[0], tail[1] - head[1]) > watch.beyond_m:
            through[:] = False
            _cross(head, tail, pose_world, beams, passed_m, watch.beyond_m, margin_m, 0.0, through)
            passed[k] = _enough(through, watch)
        if supposed[k]:
            through[:] = False
            _cross(head, corners[k], pose_world, beams, passed_m, 0.0, margin_m, margin_m, through)
            _cross(corners[k], tail, pose_world, beams, passed_m, 0.0, margin_m, margin_m, through)
            cut_off[k] = _enough(through, watch)
    return pairs, passed, supposed, cut_off


@compiled
def _enough(through: Bool[np.ndarray, " k"], watch: Watch) -> bool:
    return bool(np.count_nonzero(through) >= watch.beams)
