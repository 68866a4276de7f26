"""How far walls were seen, and what beams contradict of them: the loops of `extents`, on the columns of the records."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.line_kernels import GRAZING
from ...geometry.numerics import TINY
from .ray_kernels import crossings, reaching
from .wall_kernels import distances, ends_world


@compiled
def _along(
    point_robot: Float[np.ndarray, "2"],
    pose_world: Float[np.ndarray, "3"],
    anchor: Float[np.ndarray, "2"],
    alpha: float,
) -> float:
    """Return how far along a line of direction alpha from its anchor a point lies, m."""
    c, s = math.cos(pose_world[2]), math.sin(pose_world[2])
    east = c * point_robot[0] - s * point_robot[1] + pose_world[0] - anchor[0]
    north = s * point_robot[0] + c * point_robot[1] + pose_world[1] - anchor[1]
    return north * math.cos(alpha) - east * math.sin(alpha)


@compiled
def seen_along(
    ends: Float[np.ndarray, "m 2 2"],
    lines: Float[np.ndarray, "m 2"],
    rows: Int[np.ndarray, " m"],
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    step_rad: float,
) -> tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, "m 2"]]:
    """Return where the ends of segments lie along their walls, m, and how far beams stand apart there.

    `rows` holds the row of each segment's wall, -1 for none.
    """
    along, apart = np.empty((len(rows), 2)), np.empty((len(rows), 2))
    for k in range(len(rows)):
        row = rows[k]
        if row < 0:
            continue
        for side in range(2):
            along[k, side] = _along(ends[k, side], pose_world, anchors[row], means[row, 0])
            distance = math.hypot(ends[k, side, 0], ends[k, side, 1])
            cosine = min(max(lines[k, 1] / max(distance, TINY), GRAZING), 1.0)
            apart[k, side] = step_rad * distance / cosine
    return along, apart


@compiled
def stretch(
    rows: Int[np.ndarray, " m"],
    along: Float[np.ndarray, "m 2"],
    apart: Float[np.ndarray, "m 2"],
    at_corner: Bool[np.ndarray, "m 2"],
    extents: Float[np.ndarray, "n 2"],
    spacing: Float[np.ndarray, "n 2"],
) -> None:
    """Move the ends outwards to what was seen, and inwards where a corner was seen more sharply than before."""
    for side in range(2):
        outward = -1.0 if side == 0 else 1.0
        for k in range(len(rows)):
            row = rows[k]
            if row < 0:
                continue
            beyond = outward * (along[k, side] - extents[row, side])
            sharper = at_corner[k, side] and apart[k, side] < spacing[row, side]
            if beyond > 0.0 or (sharper and -beyond < spacing[row, side]):
                extents[row, side] = along[k, side]
                spacing[row, side] = apart[k, side]


@compiled
def cut_back(
    near: Int[np.ndarray, " n"],
    along: Float[np.ndarray, "n k"],
    across: Float[np.ndarray, "n k"],
    ranges_m: Float[np.ndarray, " k"],
    extents: Float[np.ndarray, "w 2"],
    spacing: Float[np.ndarray, "w 2"],
    against: Int[np.ndarray, " w"],
    margin_m: float,
    trim_m: float,
    twice: int,
) -> None:
    """Cut walls back where beams pass through them in scan after scan: a door, or a wall that never was."""
    for k in range(len(near)):
        row = near[k]
        inside = np.zeros(along.shape[1], np.bool_)
        # All of a wall as short as a leg or a door's end lies near its ends: there its middle half counts.
        apart_m = min(margin_m, 0.25 * (extents[row, 1] - extents[row, 0]))
        for beam in range(len(inside)):
            inside[beam] = extents[row, 0] + apart_m < along[k, beam] < extents[row, 1] - apart_m
        passes = inside & (across[k] > margin_m)
        against[row] = against[row] + 1 if np.any(passes) else 0
        if against[row] >= twice:
            hits = inside & np.isfinite(ranges_m) & (np.abs(across[k]) <= margin_m)
            kept = kept_piece(extents[row], along[k][passes], along[k][hits], trim_m)
            for side in range(2):
                if kept[side] != extents[row, side]:
                    extents[row, side], spacing[row, side] = kept[side], margin_m
            against[row] = 0


@compiled
def kept_piece(
    extent: Float[np.ndarray, "2"], through: Float[np.ndarray, " p"], on: Float[np.ndarray, " h"], trim_m: float
) -> Float[np.ndarray, "2"]:
    """Return the piece between passing beams that most beams end on (else the longest), cut back to its hits.

    By less than `trim_m`: beams stand apart.
    """
    pieces = len(through) + 1
    bounds = np.empty(pieces + 1)
    bounds[0], bounds[1:pieces], bounds[pieces] = extent[0], np.sort(through), extent[1]
    best, most = 0, -1
    for piece in range(pieces):
        low, high, count = bounds[piece], bounds[piece + 1], 0
        for h in range(len(on)):
            count += low <= on[h] and (on[h] < high or (on[h] == high and piece == pieces - 1))
        if count > most or (count == most and high - low >= bounds[best + 1] - bounds[best]):
            best, most = piece, count
    kept = bounds[best : best + 2].copy()
    first, last = math.inf, -math.inf
    for h in range(len(on)):
        if kept[0] <= on[h] <= kept[1]:
            first, last = min(first, on[h]), max(last, on[h])
    if best > 0 and first - kept[0] < trim_m:
        kept[0] = first
    if best < pieces - 1 and kept[1] - last < trim_m:
        kept[1] = last
    return kept


@compiled
def take_in(
    ends: Float[np.ndarray, "s 2 2"],
    lines: Float[np.ndarray, "s 2"],
    at_corner: Bool[np.ndarray, "s 2"],
    rows: Int[np.ndarray, " s"],
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    step_rad: float,
    extents: Float[np.ndarray, "n 2"],
    spacing: Float[np.ndarray, "n 2"],
    observations: Int[np.ndarray, " n"],
) -> Bool[np.ndarray, " n"]:
    """Stretch the walls in `rows` over the segments of one scan, and return which it shows."""
    along, apart = seen_along(ends, lines, rows, pose_world, anchors, means, step_rad)
    stretch(rows, along, apart, at_corner, extents, spacing)
    shown = np.zeros(len(extents), np.bool_)
    for row in rows:
        if row >= 0:
            shown[row] = True
    observations += shown
    return shown


@compiled
def contradict(
    bearings_rad: Float[np.ndarray, " k"],
    ranges_m: Float[np.ndarray, " k"],
    passed_m: Float[np.ndarray, " k"],
    range_max_m: float,
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "w 2"],
    means: Float[np.ndarray, "w 2"],
    extents: Float[np.ndarray, "w 2"],
    spacing: Float[np.ndarray, "w 2"],
    against: Int[np.ndarray, " w"],
    reach_m: float,
    margin_m: float,
    trim_m: float,
    twice: int,
) -> Int[np.ndarray, " w"]:
    """Cut back the walls within range; return how many beams reach each, as far as it went before."""
    near = np.flatnonzero(distances(pose_world[:2], ends_world(anchors, means, extents)) < range_max_m)
    along, across = crossings(bearings_rad, passed_m, pose_world, anchors[near], means[near])
    beams = np.zeros(len(extents), np.int64)
    beams[near] = reaching(along, across, extents[near], reach_m)
    cut_back(near, along, across, ranges_m, extents, spacing, against, margin_m, trim_m, twice)
    return beams
