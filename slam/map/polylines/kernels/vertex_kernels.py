"""Where walls may make a bend, and which segments and walls lie across one: the loops of `vertices`."""

import math
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from ....geometry.compiled import compiled
from ....geometry.matrix_kernels import wrapped


class Bends(NamedTuple):
    """Where walls may make a bend."""

    rows: Int[np.ndarray, "b 2"]
    """Of the walls before and after it."""
    points_world: Float[np.ndarray, "b 2"]
    """Where it lies, m: where the lines cross, if both walls end or overlap there; else amid the two ends."""
    turn_rad: Float[np.ndarray, " b"]
    """From one normal to the other, without its sign."""
    cross: Bool[np.ndarray, " b"]
    """Whether it lies where the lines cross."""
    overlap: Bool[np.ndarray, " b"]
    """Whether the walls overlap, by more than ends are known to."""
    is_cut: Bool[np.ndarray, " b"]
    """Whether it is known that they are two."""


class Bounds(NamedTuple):
    """The numbers that the loops read."""

    resolution_m: float
    """A segment goes on at least so far on both sides of a bend, and walls that overlap by less do not."""
    beside_m: float
    """Distance across a segment within which a bend lies on it."""
    thickness_m: float
    """Largest gap between the end of one wall and the beginning of the next. They may overlap: a line over both was
    given to one of them, which then reaches past the bend."""
    beyond_m: float
    """A wall that reaches so far beyond a bend that a scan shows, on both sides, was laid across it: a beam of the
    other side may have been taken in, at 4 m one in 0.13 m."""
    far_m: float
    """The same gap between two walls that are known to be pieces of one bent wall: far from the robot no beam may have
    met either of them near the bend."""
    largest_rad: float
    """A sharper bend is seen in every scan."""
    sharp_rad: float
    """And the largest turn of such a bend: round an apse of eight sides two of them are one line to a few scans."""


@compiled
def bends(
    rows: Int[np.ndarray, " n"],
    ids: Int[np.ndarray, " w"],
    alpha: Float[np.ndarray, " w"],
    ends: Float[np.ndarray, "w 2 2"],
    cut: Int[np.ndarray, "p 2"],
    bounds: Bounds,
) -> Bends:
    """Return where bends may lie between the walls in some rows; `cut` are pairs of ids that are surely two walls."""
    n = len(rows)
    pairs, points, turns = np.empty((n * n, 2), np.int64), np.empty((n * n, 2)), np.empty(n * n)
    crosses, overlaps, cuts, count = np.empty(n * n, np.bool_), np.empty(n * n, np.bool_), np.empty(n * n, np.bool_), 0
    for before in rows:
        nx, ny = math.cos(alpha[before]), math.sin(alpha[before])
        x, y = ends[before, 1]
        length = math.hypot(x - ends[before, 0, 0], y - ends[before, 0, 1])
        for after in rows:
            # The other wall's ends as seen from the head of this one: along it, and across.
            east, north = ends[after, 0, 0] - x, ends[after, 0, 1] - y
            gap, across = nx * north - ny * east, nx * east + ny * north
            runs_on = nx * (ends[after, 1, 1] - y) - ny * (ends[after, 1, 0] - x) > 0.0
            if not (-length < gap and runs_on and abs(across) < bounds.beside_m):
                continue
            turn = wrapped(alpha[after] - alpha[before])
            is_cut = _are_pair(ids[before], ids[after], cut)
            reach = bounds.far_m if is_cut else bounds.thickness_m
            if gap >= reach or abs(turn) >= bounds.largest_rad:
                continue
            slope = math.tan(turn)
            crossing = gap + across / slope if slope != 0.0 else math.inf
            cross = min(gap, 0.0) - bounds.thickness_m < crossing < max(gap, 0.0) + bounds.thickness_m
            at = crossing if cross else 0.5 * gap
            pairs[count, 0], pairs[count, 1] = before, after
            points[count, 0], points[count, 1] = x - ny * at, y + nx * at
            turns[count], crosses[count] = abs(turn), cross
            overlaps[count], cuts[count] = gap < -bounds.resolution_m, is_cut
            count += 1
    return Bends(
        pairs[:count].copy(),
        points[:count].copy(),
        turns[:count].copy(),
        crosses[:count].copy(),
        overlaps[:count].copy(),
        cuts[:count].copy(),
    )


@compiled
def _are_pair(one: int, other: int, pairs: Int[np.ndarray, "p 2"]) -> bool:
    """Return whether two ids are one of the pairs, in either order."""
    for p in range(len(pairs)):
        if (pairs[p, 0] == one and pairs[p, 1] == other) or (pairs[p, 0] == other and pairs[p, 1] == one):
            return True
    return False


@compiled
def on_segments(
    points_world: Float[np.ndarray, "b 2"],
    alpha_world: Float[np.ndarray, " b"],
    pose_world: Float[np.ndarray, "3"],
    lines: Float[np.ndarray, "s 2"],
    ends: Float[np.ndarray, "s 2 2"],
    bounds: Bounds,
) -> tuple[Bool[np.ndarray, " b"], Float[np.ndarray, " b"]]:
    """Return which bends of the map, of such normals, lie on a segment of a scan, and their bearings from the robot."""
    on, bearings = np.zeros(len(points_world), np.bool_), np.empty(len(points_world))
    c, s = math.cos(pose_world[2]), math.sin(pose_world[2])
    for b in range(len(points_world)):
        east, north = points_world[b, 0] - pose_world[0], points_world[b, 1] - pose_world[1]
        x, y = c * east + s * north, c * north - s * east
        bearings[b] = math.atan2(y, x)
        for k in range(len(lines)):
            nx, ny = math.cos(lines[k, 0]), math.sin(lines[k, 0])
            length = math.hypot(ends[k, 1, 0] - ends[k, 0, 0], ends[k, 1, 1] - ends[k, 0, 1])
            along = nx * (y - ends[k, 0, 1]) - ny * (x - ends[k, 0, 0])
            across = nx * (x - ends[k, 0, 0]) + ny * (y - ends[k, 0, 1])
            beside = bounds.resolution_m < along < length - bounds.resolution_m and abs(across) < bounds.beside_m
            turn = wrapped(alpha_world[b] - pose_world[2] - lines[k, 0])
            on[b] = on[b] or (beside and abs(turn) < bounds.largest_rad)
    return on, bearings


@compiled
def laid_across(
    lines: Float[np.ndarray, "s 2"],
    variances: Float[np.ndarray, " s"],
    seen_ends: Float[np.ndarray, "s 2 2"],
    is_tentative: Bool[np.ndarray, " s"],
    pose_world: Float[np.ndarray, "3"],
    alpha: Float[np.ndarray, " w"],
    ends: Float[np.ndarray, "w 2 2"],
    level: float,
    bounds: Bounds,
) -> Bool[np.ndarray, " w"]:
    """Return which walls are laid across a bend that a scan shows between neighbours, surely at a `level`."""
    laid = np.zeros(len(alpha), np.bool_)
    c, s = math.cos(pose_world[2]), math.sin(pose_world[2])
    for k in range(len(lines)):
        after = (k + 1) % len(lines)
        turn = wrapped(lines[after, 0] - lines[k, 0])
        x, y = seen_ends[after, 0, 0] - seen_ends[k, 1, 0], seen_ends[after, 0, 1] - seen_ends[k, 1, 1]
        blunt = abs(turn) < bounds.sharp_rad
        shown = turn * turn > level * (variances[k] + variances[after])
        shown = shown and not (is_tentative[k] or is_tentative[after])
        if not (shown and blunt and math.hypot(x, y) < bounds.far_m):
            continue
        x, y = seen_ends[k, 1, 0] + 0.5 * x, seen_ends[k, 1, 1] + 0.5 * y
        east, north = c * x - s * y + pose_world[0], s * x + c * y + pose_world[1]
        normal = lines[k, 0] + pose_world[2] + 0.5 * turn
        for wall in range(len(alpha)):
            nx, ny = math.cos(alpha[wall]), math.sin(alpha[wall])
            across = nx * (east - ends[wall, 0, 0]) + ny * (north - ends[wall, 0, 1])
            begins = nx * (north - ends[wall, 0, 1]) - ny * (east - ends[wall, 0, 0])
            goes_on = ny * (east - ends[wall, 1, 0]) - nx * (north - ends[wall, 1, 1])
            if min(begins, goes_on) > bounds.beyond_m and abs(across) < bounds.beside_m:
                laid[wall] = laid[wall] or abs(wrapped(alpha[wall] - normal)) < bounds.largest_rad
    return laid
