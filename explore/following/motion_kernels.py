"""Which steps come next: the cheapest sequence of whole motions to a horizon, none of which touches a return."""

import math
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.compiled import compiled

from ..planning.field import Field

WALK_CELLS = 6
"""Where the field leads on from a place is told over so many cells."""
MOST, TABLE = 8192, 1 << 14
"""A search looks at so many poses at most, and finds them again in a table of this size."""


class Motions(NamedTuple):
    """The steps among which one is chosen, and the body that takes them."""

    places: Float[np.ndarray, "a s 3"]
    """Poses on the way of each step, m m rad from its start, the last at its end."""
    costs_m: Float[np.ndarray, " a"]
    clear_m: Float[np.ndarray, " a"]
    """Between the body and all returns on the way of each, unless the step comes no nearer to any."""
    wide_m: float
    """Less room than this costs more."""
    turn_m: float
    """What a radian of turn costs that is left at the horizon."""
    back: float
    """What a metre backwards costs, of one ahead; infinite for a robot that cannot reverse."""
    metre: float
    """What a metre ahead costs, with its share of a step."""
    corners_m: Float[np.ndarray, "c 2"]
    """Of the body; none for a disc."""
    radius_m: float


@compiled
def _off_outline(x: float, y: float, corners_m: Float[np.ndarray, "c 2"]) -> float:
    """Return how far a point in the body's frame is from its outline, less than 0 inside."""
    least, inside = math.inf, True
    for k in range(len(corners_m)):
        ax, ay = corners_m[k, 0], corners_m[k, 1]
        after = k + 1 if k + 1 < len(corners_m) else 0
        ex, ey = corners_m[after, 0] - ax, corners_m[after, 1] - ay
        dx, dy = x - ax, y - ay
        inside = inside and ex * dy - ey * dx >= 0.0
        share = min(max((ex * dx + ey * dy) / (ex * ex + ey * ey), 0.0), 1.0)
        least = min(least, math.hypot(dx - share * ex, dy - share * ey))
    return -least if inside else least


@compiled
def clearance_m(
    x: float, y: float, heading: float, points: Float[np.ndarray, "m 2"], body: Motions, beyond_m: float
) -> float:
    """Return the distance between the body at a pose and the nearest point, at most `beyond_m`; below 0 inside."""
    least, c, s = beyond_m, math.cos(heading), math.sin(heading)
    for k in range(len(points)):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        reach = least + body.radius_m
        if dx * dx + dy * dy >= reach * reach and reach > 0.0:
            continue
        if len(body.corners_m):
            least = min(least, _off_outline(c * dx + s * dy, c * dy - s * dx, body.corners_m))
        else:
            least = min(least, math.hypot(dx, dy) - body.radius_m)
    return least


@compiled
def metres_at(x: float, y: float, heading: float, field: Field) -> float:
    """Return the field at a pose, between cells and headings in proportion."""
    u, v = (x - field.corner_world[0]) / field.cell_m - 0.5, (y - field.corner_world[1]) / field.cell_m - 0.5
    column, row = int(math.floor(u)), int(math.floor(v))
    total, weight, turns = 0.0, 0.0, len(field.headings_rad)
    first, share = 0, 0.0
    if turns > 1:
        first = turns - 1
        for k in range(turns):
            if field.headings_rad[k] <= heading:
                first = k
        gap = (field.headings_rad[(first + 1) % turns] - field.headings_rad[first]) % (2.0 * math.pi)
        share = ((heading - field.headings_rad[first]) % (2.0 * math.pi)) / gap
    for r in range(row, row + 2):
        for c in range(column, column + 2):
            if not (0 <= r < field.metres.shape[0] and 0 <= c < field.metres.shape[1]):
                continue
            part = (1.0 - abs(v - r)) * (1.0 - abs(u - c))
            for k in range(2 if turns > 1 else 1):
                metres = field.metres[r, c, (first + k) % turns]
                if math.isfinite(metres):
                    each = part * ((share if k else 1.0 - share) if turns > 1 else 1.0)
                    total, weight = total + each * metres, weight + each
    return total / weight if weight > 1e-6 else math.inf


@compiled
def cells_ahead(x: float, y: float, count: int, field: Field) -> Int[np.ndarray, "n 2"]:
    """Return the cells (row, column) by which the field leads on from a place, its own first; none outside."""
    cells = np.empty((count, 2), np.int64)
    c = int(math.floor((x - field.corner_world[0]) / field.cell_m))
    r = int(math.floor((y - field.corner_world[1]) / field.cell_m))
    h, w, turns = field.metres.shape
    if not (0 <= r < h and 0 <= c < w):
        return cells[:0]
    least = math.inf
    for n in range(count):
        cells[n] = r, c
        to_r, to_c = r, c
        for rr in range(max(r - 1, 0), min(r + 2, h)):
            for cc in range(max(c - 1, 0), min(c + 2, w)):
                for k in range(turns):
                    if field.metres[rr, cc, k] < least:
                        least, to_r, to_c = field.metres[rr, cc, k], rr, cc
        if to_r == r and to_c == c:
            return cells[: n + 1]
        r, c = to_r, to_c
    return cells


@compiled
def _turn_left(x: float, y: float, heading: float, field: Field) -> float:
    """Return by how much the robot would have to turn to face the way on, rad."""
    cells = cells_ahead(x, y, WALK_CELLS, field)
    if len(cells) < 3:
        return 0.0
    dx = field.corner_world[0] + (cells[-1, 1] + 0.5) * field.cell_m - x
    dy = field.corner_world[1] + (cells[-1, 0] + 0.5) * field.cell_m - y
    return abs((math.atan2(dy, dx) - heading + math.pi) % (2.0 * math.pi) - math.pi)


@compiled
def _left_m(x: float, y: float, heading: float, field: Field, motions: Motions) -> float:
    """Return what the way from a pose costs: the field, and the turn to face it."""
    metres = metres_at(x, y, heading, field)
    if not math.isfinite(metres) or len(field.headings_rad) > 1:
        return motions.metre * metres
    turn = _turn_left(x, y, heading, field)
    backwards = motions.turn_m * (math.pi - turn) + (motions.back - 1.0) * motions.metre * metres
    return motions.metre * metres + min(motions.turn_m * turn, backwards)


@compiled
def _clear_on(
    x: float, y: float, heading: float, a: int, now_m: float, points: Float[np.ndarray, "m 2"], motions: Motions
) -> tuple[float, float]:
    """Return the clearance on a step, -inf where the step is not safe, and at its end."""
    c, s, least, end_m = math.cos(heading), math.sin(heading), motions.wide_m, motions.wide_m
    allowed = min(motions.clear_m[a], now_m)
    for k in range(motions.places.shape[1] - 1, -1, -1):  # most of what is in the way is so at the end
        px, py, turn = motions.places[a, k]
        away = clearance_m(x + c * px - s * py, y + s * px + c * py, heading + turn, points, motions, motions.wide_m)
        if away < allowed:
            return -math.inf, -math.inf
        least = min(least, away)
        if k == motions.places.shape[1] - 1:
            end_m = away
    return least, end_m


@compiled
def _near(
    points: Float[np.ndarray, "m 2"], x: float, y: float, reach_m: float
) -> Float[np.ndarray, "n 2"]:
    kept, count = np.empty_like(points), 0
    for k in range(len(points)):
        dx, dy = points[k, 0] - x, points[k, 1] - y
        if dx * dx + dy * dy < reach_m * reach_m:
            kept[count] = points[k]
            count += 1
    return kept[:count]


@compiled
def cost_of_plan(
    start_world: Float[np.ndarray, "3"],
    plan: Int[np.ndarray, " n"],
    points_world: Float[np.ndarray, "m 2"],
    motions: Motions,
    field: Field,
) -> float:
    """Return what a sequence of steps and the way from its end cost from a pose, m; infinite where a step is unsafe."""
    x, y, heading = start_world
    cost = 0.0
    for a in plan:
        now_m = clearance_m(x, y, heading, points_world, motions, motions.wide_m)
        least, _ = _clear_on(x, y, heading, a, now_m, points_world, motions)
        if least == -math.inf:
            return math.inf
        cost += motions.costs_m[a] * (2.0 - least / motions.wide_m)
        px, py, turn = motions.places[a, -1]
        c, s = math.cos(heading), math.sin(heading)
        x, y = x + c * px - s * py, y + s * px + c * py
        heading = (heading + turn + math.pi) % (2.0 * math.pi) - math.pi
    return cost + _left_m(x, y, heading, field, motions)


@compiled
def search(
    start_world: Float[np.ndarray, "3"],
    points_world: Float[np.ndarray, "m 2"],
    motions: Motions,
    field: Field,
    horizon_m: float,
    apart: Float[np.ndarray, "2"],
    gain_m: float,
) -> tuple[Int[np.ndarray, " n"], int]:
    """Return the steps of the cheapest way to the horizon or to the end of the field, and how many poses were expanded.

    Poses no farther `apart` (m, rad) count as one. After `MOST` of them, the way to the best so far will do if it saves
    `gain_m`; else there is none.
    """
    count_a = len(motions.costs_m)
    poses, spent, clear = np.empty((MOST, 3)), np.empty(MOST), np.empty(MOST)
    parent, by = np.empty(MOST, np.int64), np.empty(MOST, np.int64)
    keys, least_g = np.zeros(TABLE, np.int64), np.empty(TABLE)
    longest = 0.0
    for a in range(count_a):
        longest = max(longest, math.hypot(motions.places[a, -1, 0], motions.places[a, -1, 1]))
    x0, y0 = start_world[0], start_world[1]
    around = _near(points_world, x0, y0, horizon_m + 2.0 * longest + motions.radius_m + motions.wide_m)
    poses[0] = start_world
    spent[0], parent[0], by[0] = 0.0, -1, -1
    clear[0] = clearance_m(x0, y0, start_world[2], around, motions, motions.wide_m)
    left = _left_m(x0, y0, start_world[2], field, motions)
    first_m = left if math.isfinite(left) else 1e6
    best, best_m = -1, first_m - gain_m
    queue = [(first_m, 0)]
    count, expanded, found = 1, 0, -1
    while len(queue) > 0 and count + count_a <= MOST:
        _, node = heappop(queue)
        x, y, heading = poses[node]
        g = spent[node]
        slot = _slot(x, y, heading, apart, keys)
        if keys[slot] != 0 and least_g[slot] < g:
            continue
        far = math.hypot(x - x0, y - y0) >= horizon_m
        column = int(math.floor((x - field.corner_world[0]) / field.cell_m))
        row = int(math.floor((y - field.corner_world[1]) / field.cell_m))
        inside = 0 <= row < field.metres.shape[0] and 0 <= column < field.metres.shape[1]
        if node > 0 and (far or (inside and field.metres[row, column, 0] <= 0.0)):
            found = node
            break
        expanded += 1
        near = _near(around, x, y, longest + motions.radius_m + motions.wide_m)
        c, s = math.cos(heading), math.sin(heading)
        for a in range(count_a):
            px, py, turn = motions.places[a, -1]
            ex, ey = x + c * px - s * py, y + s * px + c * py
            to = (heading + turn + math.pi) % (2.0 * math.pi) - math.pi
            cost = g + motions.costs_m[a]
            slot = _slot(ex, ey, to, apart, keys)
            if keys[slot] != 0 and least_g[slot] <= cost:
                continue
            left = _left_m(ex, ey, to, field, motions)
            if not math.isfinite(left):
                continue
            room_m, end_m = _clear_on(x, y, heading, a, clear[node], near, motions)
            if room_m == -math.inf:
                continue
            cost += motions.costs_m[a] * (1.0 - room_m / motions.wide_m)
            if keys[slot] != 0 and least_g[slot] <= cost:
                continue
            keys[slot], least_g[slot] = _key(ex, ey, to, apart), cost
            poses[count, 0], poses[count, 1], poses[count, 2] = ex, ey, to
            spent[count], clear[count], parent[count], by[count] = cost, end_m, node, a
            if left + 0.25 * cost < best_m:
                best, best_m = count, left + 0.25 * cost
            heappush(queue, (cost + left, count))
            count += 1
    if found < 0:
        found = best
    steps = 0
    node = found
    while node > 0:
        node = parent[node]
        steps += 1
    plan, node = np.empty(steps, np.int64), found
    for k in range(steps - 1, -1, -1):
        plan[k] = by[node]
        node = parent[node]
    return plan, expanded


@compiled
def _key(x: float, y: float, heading: float, apart: Float[np.ndarray, "2"]) -> int:
    turns = int(round(2.0 * math.pi / apart[1]))
    column, row = int(math.floor(x / apart[0])), int(math.floor(y / apart[0]))
    turn = int(round(heading / apart[1])) % turns
    return ((column + 1000000) * 2000003 + row + 1000000) * 1024 + turn + 1


@compiled
def _slot(x: float, y: float, heading: float, apart: Float[np.ndarray, "2"], keys: Int[np.ndarray, " n"]) -> int:
    """Return where in a table of keys a pose stands, or would."""
    key = _key(x, y, heading, apart)
    size = len(keys)
    slot = ((key * 2654435761) >> 13) & (size - 1)
    while keys[slot] != 0 and keys[slot] != key:
        slot = (slot + 1) & (size - 1)
    return slot
