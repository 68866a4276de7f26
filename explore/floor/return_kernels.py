"""Loops over the beams of a scan, and over what they hit."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.compiled import compiled
from chainslam.slam.geometry.matrix_kernels import wrapped


@compiled
def lengths_of_runs(
    flags: Bool[np.ndarray, " k"], held: Bool[np.ndarray, " k"], is_full_turn: bool
) -> Int[np.ndarray, " k"]:
    """Return of each beam the length of the run of flags that it is in; 0 outside of runs, and in those not held whole.

    Over a full turn the last beam is followed by the first.
    """
    beams, begin = len(flags), 0
    while is_full_turn and begin < beams and flags[begin]:
        begin += 1
    lengths, last = np.zeros(beams, dtype=np.int64), begin + beams
    while begin < last:
        end, is_held = begin, True
        while end < last and flags[end % beams]:
            is_held = is_held and held[end % beams]
            end += 1
        for k in range(begin, end if is_held else begin):
            lengths[k % beams] = end - begin
        begin = end + 1
    return lengths


@compiled
def must_meet(
    points: Float[np.ndarray, "p 2"],
    beams: int,
    first_rad: float,
    step_rad: float,
    is_full_turn: bool,
    reach_m: float,
    apart_m: float,
    margin: int,
) -> Bool[np.ndarray, " b"]:
    """Return which beams, and so many neighbours on either side, meet a surface of points in their order.

    Unknown points are NaN, which compares as False; a surface seen from behind has its beams in the other order.
    Of less than a full turn no beam meets what begins before the first.
    """
    met = np.zeros(beams, dtype=np.bool_)
    for k in range(len(points) - 1):
        (ax, ay), (bx, by) = points[k], points[k + 1]
        turn_rad = math.atan2(ax * by - ay * bx, ax * bx + ay * by)
        if (
            math.hypot(bx - ax, by - ay) < apart_m
            and turn_rad > 0.0
            and max(math.hypot(ax, ay), math.hypot(bx, by)) < reach_m
        ):
            begin = (math.atan2(ay, ax) - first_rad) % (2.0 * math.pi) / step_rad
            for beam in range(math.ceil(begin), math.floor(begin + turn_rad / step_rad) + 1):
                if is_full_turn or beam < beams:
                    met[beam % beams] = True
    meets = np.empty(beams, dtype=np.bool_)
    for beam in range(beams):
        meets[beam] = True
        for off in range(-margin, margin + 1):
            meets[beam] &= met[(beam + off) % beams]
    return meets


@compiled
def same_places(
    points: Float[np.ndarray, "p 2"],
    same_m: Float[np.ndarray, " p"],
    recent: Float[np.ndarray, "r 2"],
    near_m: float,
    same_rad: float,
) -> tuple[Int[np.ndarray, " n"], Float[np.ndarray, " n"], Float[np.ndarray, " r"], Float[np.ndarray, "n r"]]:
    """Return which points are near, their distances, those of recent ones, and 1 for each pair that is of one place."""
    before, at = np.empty(len(recent)), np.empty(len(recent))
    for r in range(len(recent)):
        before[r], at[r] = math.hypot(recent[r, 0], recent[r, 1]), math.atan2(recent[r, 1], recent[r, 0])
    rho = np.empty(len(points))
    for p in range(len(points)):
        rho[p] = math.hypot(points[p, 0], points[p, 1])
    near = np.flatnonzero(rho < near_m)
    same = np.zeros((len(near), len(recent)))
    for n in range(len(near)):
        p = near[n]
        bearing, apart_m = math.atan2(points[p, 1], points[p, 0]), same_m[p] + rho[p] * same_rad
        for r in range(len(recent)):
            if abs(points[p, 0] - recent[r, 0]) < apart_m and abs(rho[p] - before[r]) < same_m[p]:
                same[n, r] = abs(wrapped(bearing - at[r])) < same_rad
    return near, rho[near], before, same


@compiled
def hits_of(bearings_rad: Float[np.ndarray, " k"], ranges_m: Float[np.ndarray, " k"]) -> Float[np.ndarray, "m 2"]:
    """Return the points that the beams with a return hit, scanner's frame, m."""
    points, count = np.empty((len(ranges_m), 2)), 0
    for k in range(len(ranges_m)):
        if math.isfinite(ranges_m[k]):
            points[count, 0] = ranges_m[k] * math.cos(bearings_rad[k])
            points[count, 1] = ranges_m[k] * math.sin(bearings_rad[k])
            count += 1
    return points[:count]


@compiled
def amid_free_floor(evidence: Int[np.ndarray, "h w"], cells: Int[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
    """Return which cells, row and column, are free with no occupied one beside them; those off the grid are not."""
    height, width = evidence.shape
    amid = np.empty(len(cells), dtype=np.bool_)
    for n in range(len(cells)):
        row, column = cells[n]
        amid[n] = 0 <= row < height and 0 <= column < width and evidence[row, column] < 0
        if amid[n]:
            around = evidence[max(row - 1, 0) : row + 2, max(column - 1, 0) : column + 2]
            amid[n] = around.max() <= 0
    return amid
