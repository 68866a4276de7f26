"""What the beams of one scan say of turns of walls, at places along them: the loops of `change_points`."""

import math

import numpy as np
from jaxtyping import Float, Int

from ....geometry.compiled import compiled
from ....geometry.numerics import TINY


@compiled
def feet_along(
    lines: Float[np.ndarray, "m 2"],
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "m 2"],
    alpha: Float[np.ndarray, " m"],
) -> Float[np.ndarray, " m"]:
    """Return how far along walls, each from its anchor, the feet of the robot's perpendiculars to seen lines lie, m."""
    feet = np.empty(len(lines))
    for k in range(len(lines)):
        turned, r = lines[k, 0] + pose_world[2], lines[k, 1]
        east = pose_world[0] + r * math.cos(turned) - anchors[k, 0]
        north = pose_world[1] + r * math.sin(turned) - anchors[k, 1]
        feet[k] = north * math.cos(alpha[k]) - east * math.sin(alpha[k])
    return feet


@compiled
def beams_on_lines(
    runs: Int[np.ndarray, "m 2"],
    lines: Float[np.ndarray, "m 2"],
    feet: Float[np.ndarray, " m"],
    bearings_rad: Float[np.ndarray, " b"],
    ranges_m: Float[np.ndarray, " b"],
    sigmas_m: Float[np.ndarray, " b"],
    gate_sigmas: float,
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"], Float[np.ndarray, " k"], Int[np.ndarray, " k"]]:
    """Return where beams meet the lines of segments, m along walls, by how much they miss them, its sigma, and whose.

    Each segment has the beams from its first to its last, in a turn of the scanner; those two may be of another face.
    """
    most, turn = 0, len(bearings_rad)
    for k in range(len(runs)):
        most += (runs[k, 1] - runs[k, 0]) % turn + 1
    along, across, sigma, of = np.empty(most), np.empty(most), np.empty(most), np.empty(most, np.int64)
    count = 0
    for k in range(len(runs)):
        beams = (runs[k, 1] - runs[k, 0]) % turn + 1
        for number in range(beams):
            beam = (runs[k, 0] + number) % turn
            off_normal = bearings_rad[beam] - lines[k, 0]
            cosine = math.cos(off_normal)
            off = ranges_m[beam] * cosine - lines[k, 1]
            ours = abs(off) < gate_sigmas * sigmas_m[beam] * cosine
            from_end = min(number, beams - 1 - number)
            if ours and from_end >= 1:
                # Where beams meet the line, not where they ended: at a flat angle noise in range is noise along it.
                along[count] = feet[k] + lines[k, 1] * math.tan(off_normal)
                across[count], sigma[count], of[count] = off, sigmas_m[beam] * cosine, k
                count += 1
    return along[:count].copy(), across[:count].copy(), sigma[:count].copy(), of[:count].copy()


@compiled
def places_between(
    along: Float[np.ndarray, " k"], of: Int[np.ndarray, " k"], pitch_m: float
) -> tuple[Int[np.ndarray, " p"], Int[np.ndarray, " p"]]:
    """Return the places, in pitches, between the first and the last beam on each wall, and whose they are.

    The beams are given wall by wall, in the order in which they meet it.
    """
    place, place_of, count = np.empty(8, np.int64), np.empty(8, np.int64), 0
    start = 0
    while start < len(of):
        stop = start
        while stop < len(of) and of[stop] == of[start]:
            stop += 1
        first, last = math.floor(along[start] / pitch_m) + 1, math.ceil(along[stop - 1] / pitch_m)
        for at in range(first, last):
            if count == len(place):
                place = np.concatenate((place, np.empty(count, np.int64)))
                place_of = np.concatenate((place_of, np.empty(count, np.int64)))
            place[count], place_of[count] = at, of[start]
            count += 1
        start = stop
    return place[:count].copy(), place_of[:count].copy()


@compiled
def turns_of_beams(
    along: Float[np.ndarray, " k"],
    across: Float[np.ndarray, " k"],
    sigma: Float[np.ndarray, " k"],
    of: Int[np.ndarray, " k"],
    places: Float[np.ndarray, " p"],
    place_of: Int[np.ndarray, " p"],
    least_beams: int,
) -> Float[np.ndarray, "2 p"]:
    """Return the sums of beams at `along`, off lines by `across`, m: by how much more per metre a wall leads away.

    Beyond each place, whatever its line; nothing where fewer than so many beams lie on either side. The model is
    across = a + b along + turn max(along - place, 0); a and b are eliminated. Beams, and places, are given wall by wall
    in ascending order.
    """
    turns = np.zeros((2, len(places)))
    start, stop = 0, 0
    for p in range(len(places)):
        while stop < len(of) and of[stop] <= place_of[p]:
            start = start if of[stop] == of[start] else stop
            stop += 1
        middle = 0.5 * (along[start] + along[stop - 1])
        s, beyond = places[p] - middle, start
        t0, t1, t2, f0, f1, w0, w1, w2, e0, e1 = 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(start, stop):
            x, weight = along[k] - middle, 1.0 / (sigma[k] * sigma[k])
            t0, t1, t2 = t0 + weight, t1 + weight * x, t2 + weight * x * x
            f0, f1 = f0 + weight * across[k], f1 + weight * x * across[k]
            if x <= s:
                beyond = k + 1
            else:
                w0, w1, w2 = w0 + weight, w1 + weight * x, w2 + weight * x * x
                e0, e1 = e0 + weight * across[k], e1 + weight * x * across[k]
        enough = min(stop - beyond, beyond - start) >= least_beams
        if enough:
            h0, h1, hh, he = w1 - s * w0, w2 - s * w1, w2 - 2.0 * s * w1 + s * s * w0, e1 - s * e0
            det = t0 * t2 - t1 * t1
            a, b = (t2 * h0 - t1 * h1) / det, (t0 * h1 - t1 * h0) / det
            turns[0, p], turns[1, p] = max(hh - a * h0 - b * h1, 0.0), he - a * f0 - b * f1
    return turns


@compiled
def surest(
    information: Float[np.ndarray, " p"], sums: Float[np.ndarray, " p"], now: Float[np.ndarray, " p"], least_rad: float
) -> tuple[int, float, float]:
    """Return the place of the surest turn that the scan of now tells of, the turn, and its square in its variances."""
    best, best_turn, best_square = 0, 0.0, -1.0
    for p in range(len(sums)):
        turn = -sums[p] / max(information[p], TINY)
        is_bend = abs(turn) > least_rad
        square = turn * turn * information[p] if is_bend and now[p] > 0.0 else 0.0
        if square > best_square:
            best, best_turn, best_square = p, turn, square
    return best, best_turn, best_square
