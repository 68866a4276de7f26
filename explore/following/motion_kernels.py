"""Which steps come next: the cheapest sequence of whole motions to a horizon, none of which touches a return."""

import math
from heapq import heappop, heappush
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.compiled import compiled

from ..planning.paths import Field

WALK_CELLS = 6
"""Where the field leads on from a place is told over so many cells."""
NARROW = 3.0
"""Where there is no room beside the body a step costs so many times more."""
EXCUSED = 0.5
"""A short step keeps at least this share of its clearance from what it comes nearer to, by however little it began."""
MOST = 3000
"""A search looks at so many poses at most."""


class Motions(NamedTuple):
    """The steps among which one is chosen, and the body that takes them."""

    places: Float[np.ndarray, "a s 3"]
    """Poses on the way of each step, m m rad from its start, the last at its end."""
    costs_m: Float[np.ndarray, " a"]
    clear_m: Float[np.ndarray, " a"]
    """Between the body and all returns on the way of each ..."""
    is_short: Bool[np.ndarray, " a"]
    """... or as little as there is before, but at least half, where a step is short and no turn on the spot, on which
    wheels slip aside; what is nearer still, by noise, it comes no nearer to."""
    wide_m: float
    """Where there is less room than this a step costs more, up to four times as much."""
    horizon_m: float
    apart_m: float
    apart_rad: float
    """Poses no farther apart than this count as one."""
    metre_m: float
    """What a metre costs beyond the horizon."""
    turn_m: float
    """What a radian of turn costs that is left there."""
    back_m: float
    """What a metre costs more that is left there backwards; much for a robot that cannot."""
    corners_m: Float[np.ndarray, "c 2"]
    """Of the body; none for a disc."""
    radius_m: float


@compiled
def gap_m(dx: float, dy: float, heading: float, body: Motions) -> float:
    """Return how far a point, from the middle of the body, lies off its rim; below 0 inside."""
    corners, c, s = body.corners_m, math.cos(heading), math.sin(heading)
    if not len(corners):
        return math.hypot(dx, dy) - body.radius_m
    x, y, inside, away = c * dx + s * dy, c * dy - s * dx, True, math.inf
    for k in range(len(corners)):
        ex, ey = corners[k] - corners[k - 1]
        ax, ay = x - corners[k - 1, 0], y - corners[k - 1, 1]
        inside = inside and ex * ay - ey * ax >= 0.0
        share = min(max((ex * ax + ey * ay) / (ex * ex + ey * ey), 0.0), 1.0)
        away = min(away, math.hypot(ax - share * ex, ay - share * ey))
    return -away if inside else away


@compiled
def clearance_m(
    x: float, y: float, heading: float, points: Float[np.ndarray, "m 2"], body: Motions, most_m: float
) -> float:
    """Return the distance between the body at a pose and the nearest point, at most `most_m`; below 0 inside."""
    least = most_m
    for n in range(len(points)):
        dx, dy = points[n, 0] - x, points[n, 1] - y
        if math.hypot(dx, dy) - body.radius_m < least:
            least = min(least, gap_m(dx, dy, heading, body))
    return least


@compiled
def metres_at(x: float, y: float, heading: float, field: Field) -> float:
    """Return the field at a pose, between cells and headings in proportion."""
    h, w, turns = field.metres.shape
    u, v = (x - field.corner_world[0]) / field.cell_m - 0.5, (y - field.corner_world[1]) / field.cell_m - 0.5
    k = heading / (2.0 * math.pi) * turns
    column, row, turn = math.floor(u), math.floor(v), math.floor(k)
    total, weight = 0.0, 0.0
    for r in range(max(row, 0), min(row + 2, h)):
        for c in range(max(column, 0), min(column + 2, w)):
            for t in range(turn, turn + 2 if turns > 1 else turn + 1):
                part = (1.0 - abs(v - r)) * (1.0 - abs(u - c)) * (1.0 - abs(k - t) if turns > 1 else 1.0)
                if math.isfinite(field.metres[r, c, t % turns]):
                    total, weight = total + part * field.metres[r, c, t % turns], weight + part
    return total / weight if weight > 1e-6 else math.inf


@compiled
def cells_ahead(x: float, y: float, count: int, field: Field) -> Int[np.ndarray, "n 2"]:
    """Return the cells (row, column) by which the field leads on from a place, its own first; none outside of it."""
    h, w, turns = field.metres.shape
    c = math.floor((x - field.corner_world[0]) / field.cell_m)
    r = math.floor((y - field.corner_world[1]) / field.cell_m)
    cells, least = np.empty((count, 2), np.int64), math.inf
    if not (0 <= r < h and 0 <= c < w):
        return cells[:0]
    for n in range(count):
        cells[n] = r, c
        for rr in range(max(cells[n, 0] - 1, 0), min(cells[n, 0] + 2, h)):
            for cc in range(max(cells[n, 1] - 1, 0), min(cells[n, 1] + 2, w)):
                for k in range(turns):
                    if field.metres[rr, cc, k] < least:
                        least, r, c = field.metres[rr, cc, k], rr, cc
        if r == cells[n, 0] and c == cells[n, 1]:
            return cells[: n + 1]
    return cells


@compiled
def is_at_end(x: float, y: float, field: Field) -> bool:
    """Return whether nothing is left of the way at a place."""
    ahead = cells_ahead(x, y, 1, field)
    return len(ahead) > 0 and field.metres[ahead[0, 0], ahead[0, 1], 0] <= 0.0


@compiled
def _rest_m(x: float, y: float, heading: float, field: Field, motions: Motions) -> float:
    """Return what the way from a pose costs: the field and, for a disc, the turn to face the way on."""
    metres = metres_at(x, y, heading, field)
    if not math.isfinite(metres) or field.metres.shape[2] > 1:
        return motions.metre_m * metres
    cells, turn = cells_ahead(x, y, WALK_CELLS, field), 0.0
    if len(cells) > 2:
        dx = field.corner_world[0] + (cells[-1, 1] + 0.5) * field.cell_m - x
        dy = field.corner_world[1] + (cells[-1, 0] + 0.5) * field.cell_m - y
        turn = abs((math.atan2(dy, dx) - heading + math.pi) % (2.0 * math.pi) - math.pi)
    backwards = motions.turn_m * (math.pi - turn) + motions.back_m * metres
    return motions.metre_m * metres + min(motions.turn_m * turn, backwards)


@compiled
def step_room_m(
    pose: Float[np.ndarray, "3"], a: int, now_m: float, points: Float[np.ndarray, "m 2"], motions: Motions
) -> float:
    """Return the clearance on a step, -inf where the step is not safe; `now_m` is that before it."""
    c, s, least, is_short = math.cos(pose[2]), math.sin(pose[2]), motions.wide_m, motions.is_short[a]
    asked_m = motions.clear_m[a] * (min(max(now_m / motions.clear_m[a], EXCUSED), 1.0) if is_short else 1.0)
    for k in range(motions.places.shape[1] - 1, -1, -1):  # what is in the way mostly is so at the end
        px, py, turn = motions.places[a, k]
        x, y = pose[0] + c * px - s * py, pose[1] + s * px + c * py
        for n in range(len(points)):
            dx, dy = points[n, 0] - x, points[n, 1] - y
            if math.hypot(dx, dy) - motions.radius_m >= least:
                continue
            away = gap_m(dx, dy, pose[2] + turn, motions)
            if away < asked_m and not (
                is_short and away >= gap_m(points[n, 0] - pose[0], points[n, 1] - pose[1], pose[2], motions)
            ):
                return -math.inf
            least = min(least, away)
    return least


@compiled
def _narrow(room_m: float, motions: Motions) -> float:
    """Return how many times what it costs on open floor a step costs with so much room."""
    return 1.0 + NARROW * (1.0 - room_m / motions.wide_m) ** 2


@compiled
def after(pose: Float[np.ndarray, "3"], a: int, motions: Motions) -> Float[np.ndarray, "3"]:
    """Return the pose after a step."""
    c, s = math.cos(pose[2]), math.sin(pose[2])
    x, y, turn = motions.places[a, -1]
    heading = (pose[2] + turn + math.pi) % (2.0 * math.pi) - math.pi
    return np.array([pose[0] + c * x - s * y, pose[1] + s * x + c * y, heading])


@compiled
def cost_of_plan(
    pose: Float[np.ndarray, "3"],
    plan: Int[np.ndarray, " n"],
    points: Float[np.ndarray, "m 2"],
    first: Float[np.ndarray, "f 2"],
    motions: Motions,
    field: Field,
) -> float:
    """Return what steps and the way from their end cost, m; infinite without any, or where one is not safe.

    The first step keeps clear of `first`, too.
    """
    cost = 0.0 if len(plan) else math.inf
    if len(plan) and len(first) and step_room_m(pose, plan[0], 0.0, first, motions) == -math.inf:
        return math.inf
    for a in plan:
        now_m = clearance_m(pose[0], pose[1], pose[2], points, motions, motions.wide_m)
        room_m = step_room_m(pose, a, now_m, points, motions)
        cost += motions.costs_m[a] * _narrow(room_m, motions)
        pose = after(pose, a, motions)
    return cost + _rest_m(pose[0], pose[1], pose[2], field, motions)


@compiled
def search(
    start: Float[np.ndarray, "3"],
    points: Float[np.ndarray, "m 2"],
    first: Float[np.ndarray, "f 2"],
    motions: Motions,
    field: Field,
    gain_m: float,
) -> Int[np.ndarray, " n"]:
    """Return the steps of the cheapest way to the horizon or to the end of the field, best first (A*).

    The first step keeps clear of `first`, too, which the next scan will show. Where none gets there, the way to the
    best pose does, if it saves `gain_m`. Poses and points in one frame, m.
    """
    poses, spent, clear = np.empty((MOST, 3)), np.empty(MOST), np.empty(MOST)
    parent, by = np.empty(MOST, np.int64), np.empty(MOST, np.int64)
    steps_m, horizon_m = motions.places[:, -1, :2], motions.horizon_m
    longest_m = math.sqrt(np.max(np.sum(steps_m**2, axis=1)))
    side = int(2.0 * (horizon_m + longest_m) / motions.apart_m) + 2
    latest, below, turns = np.zeros((side, side), np.int16), np.empty(MOST, np.int16), np.empty(MOST, np.int16)
    poses[0], spent[0], parent[0], count, found = start, 0.0, -1, 1, 0
    clear[0] = clearance_m(start[0], start[1], start[2], points, motions, motions.wide_m)
    first_m = min(_rest_m(start[0], start[1], start[2], field, motions), 1e6)
    best_m, queue = first_m - gain_m, [(first_m, 0)]
    while len(queue) > 0 and count + len(steps_m) <= MOST:
        _, node = heappop(queue)
        pose = poses[node].copy()
        is_far = math.hypot(pose[0] - start[0], pose[1] - start[1]) >= horizon_m
        if node > 0 and (is_far or is_at_end(pose[0], pose[1], field)):
            found = node
            break
        reach_m = longest_m + motions.radius_m + motions.wide_m
        near = points[(points[:, 0] - pose[0]) ** 2 + (points[:, 1] - pose[1]) ** 2 < reach_m**2]
        near = np.concatenate((near, first)) if node == 0 else near
        for a in range(len(steps_m)):
            to = after(pose, a, motions)
            row = int((to[1] - start[1] + horizon_m + longest_m) / motions.apart_m)
            column = int((to[0] - start[0] + horizon_m + longest_m) / motions.apart_m)
            turn = int((to[2] + math.pi) / motions.apart_rad + 0.5)
            cost, same = spent[node] + motions.costs_m[a], latest[row, column]
            while same > 0 and turns[same] != turn:
                same = below[same]
            seen = np.float32(spent[same]) if same > 0 else np.float32(np.inf)
            if seen <= cost:
                continue
            rest_m = _rest_m(to[0], to[1], to[2], field, motions)
            room_m = step_room_m(pose, a, clear[node], near, motions) if math.isfinite(rest_m) else -math.inf
            cost = spent[node] + motions.costs_m[a] * _narrow(room_m, motions)
            if not math.isfinite(cost) or seen <= cost:
                continue
            latest[row, column], below[count], turns[count] = count, latest[row, column], turn
            poses[count], spent[count], parent[count], by[count] = to, cost, node, a
            clear[count] = clearance_m(to[0], to[1], to[2], near, motions, motions.wide_m)
            if rest_m + cost / 8.0 < best_m:
                found, best_m = count, rest_m + cost / 8.0
            heappush(queue, (cost + rest_m, count))
            count += 1
    plan = np.empty(count, np.int64)
    at = count
    while found > 0:
        at -= 1
        plan[at] = by[found]
        found = parent[found]
    return plan[at:]


@compiled
def next_steps(
    pose: Float[np.ndarray, "3"],
    plan: Int[np.ndarray, " n"],
    points: Float[np.ndarray, "m 2"],
    first: Float[np.ndarray, "f 2"],
    motions: Motions,
    field: Field,
    gain_m: float,
) -> Int[np.ndarray, " k"]:
    """Return the steps of a plan or, where a single one is left or one is not safe, those of a search, if better."""
    longest_m = math.sqrt(np.max(np.sum(motions.places[:, -1, :2] ** 2, axis=1)))
    way_m = max(motions.horizon_m, len(plan) * longest_m) + longest_m
    reach_m = way_m + motions.radius_m + motions.wide_m
    points = points[(points[:, 0] - pose[0]) ** 2 + (points[:, 1] - pose[1]) ** 2 < reach_m**2]
    cost_m = cost_of_plan(pose, plan, points, first, motions, field)
    if len(plan) < 2 or not math.isfinite(cost_m):
        found = search(pose, points, first, motions, field, gain_m)
        found_m = cost_of_plan(pose, found, points, first, motions, field)
        if found_m < cost_m - gain_m or not math.isfinite(cost_m):
            return found
    return plan
