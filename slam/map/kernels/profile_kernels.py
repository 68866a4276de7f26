"""What the beams of one scan say of steps and turns of walls, at places along them: the loops of `profiles`."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled
from ...geometry.line_kernels import lines_from
from ...geometry.numerics import TINY

LEAST_BEAMS = 2
"""So many beams must lie on either side of a break: a single one at an end may be of another face."""
SAME = 1e-6
"""A step and a turn of which beams tell less apart, as the share of the determinant, look the same to them."""


@compiled
def breaks_of_scan(
    runs: Int[np.ndarray, "s 2"],
    seen: Float[np.ndarray, "s 2"],
    ends: Float[np.ndarray, "s 2 2"],
    rows: Int[np.ndarray, " s"],
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    bearings_rad: Float[np.ndarray, " b"],
    ranges_m: Float[np.ndarray, " b"],
    sigmas_m: Float[np.ndarray, " b"],
    gate_sigmas: float,
    pitch_m: float,
) -> tuple[Int[np.ndarray, " p"], Int[np.ndarray, " p"], Float[np.ndarray, "5 p"]]:
    """Return places along the walls that a scan shows, in pitches, whose they are, and what its beams say of breaks.

    `rows` holds the row of each segment's wall, -1 for none.
    """
    order = walked(ends, rows, pose_world[2], means)
    wall_of = rows[order]
    lines, feet = lines_from(pose_world, anchors[wall_of], means[wall_of])
    beams = bearings_rad, ranges_m, sigmas_m
    along, across, sigma, of = beams_on_lines(runs[order], seen[order], wall_of, lines, feet, *beams, gate_sigmas)
    place, place_of = places_between(along, of, pitch_m)
    return place, place_of, breaks_of_beams(along, across, sigma, of, pitch_m * place, place_of)


@compiled
def walked(
    ends: Float[np.ndarray, "s 2 2"], rows: Int[np.ndarray, " s"], heading_rad: float, means: Float[np.ndarray, "n 2"]
) -> Int[np.ndarray, " m"]:
    """Return the segments that are of walls, wall by wall in ascending order, each wall's in the order of a walk."""
    order, along, count = np.empty(len(rows), np.int64), np.empty(len(rows)), 0
    for k in range(len(rows)):
        if rows[k] < 0:
            continue
        alpha = means[rows[k], 0] - heading_rad
        x, y = 0.5 * (ends[k, 0, 0] + ends[k, 1, 0]), 0.5 * (ends[k, 0, 1] + ends[k, 1, 1])
        along[k] = y * math.cos(alpha) - x * math.sin(alpha)
        place = count
        while place > 0 and (rows[order[place - 1]], along[order[place - 1]]) > (rows[k], along[k]):
            order[place] = order[place - 1]
            place -= 1
        order[place] = k
        count += 1
    return order[:count].copy()


@compiled
def beams_on_lines(
    runs: Int[np.ndarray, "m 2"],
    seen: Float[np.ndarray, "m 2"],
    wall_of: Int[np.ndarray, " m"],
    lines: Float[np.ndarray, "m 2"],
    feet: Float[np.ndarray, " m"],
    bearings_rad: Float[np.ndarray, " b"],
    ranges_m: Float[np.ndarray, " b"],
    sigmas_m: Float[np.ndarray, " b"],
    gate_sigmas: float,
) -> tuple[Float[np.ndarray, " k"], Float[np.ndarray, " k"], Float[np.ndarray, " k"], Int[np.ndarray, " k"]]:
    """Return where beams meet the lines of walls, m along these, by how much they miss them, its sigma, and whose.

    Each segment has the beams from its first to its last, in a turn of the scanner; those two may be of another face,
    and so may beams that miss the segment's own line. Segments, and the lines of their walls, are given as `walked`.
    """
    most, turn = 0, len(bearings_rad)
    for k in range(len(runs)):
        most += (runs[k, 1] - runs[k, 0]) % turn + 1
    along, across, sigma, of = np.empty(most), np.empty(most), np.empty(most), np.empty(most, np.int64)
    count = 0
    for k in range(len(runs)):
        beams = (runs[k, 1] - runs[k, 0]) % turn + 1
        for number in range(1, beams - 1):
            beam = (runs[k, 0] + number) % turn
            cosine = math.cos(bearings_rad[beam] - seen[k, 0])
            if abs(ranges_m[beam] * cosine - seen[k, 1]) < gate_sigmas * sigmas_m[beam] * cosine:
                off_normal = bearings_rad[beam] - lines[k, 0]
                # Where beams meet the line, not where they ended: at a flat angle noise in range is noise along it.
                along[count] = feet[k] + lines[k, 1] * math.tan(off_normal)
                across[count] = ranges_m[beam] * math.cos(off_normal) - lines[k, 1]
                sigma[count], of[count] = sigmas_m[beam] * cosine, wall_of[k]
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
def breaks_of_beams(
    along: Float[np.ndarray, " k"],
    across: Float[np.ndarray, " k"],
    sigma: Float[np.ndarray, " k"],
    of: Int[np.ndarray, " k"],
    places: Float[np.ndarray, " p"],
    place_of: Int[np.ndarray, " p"],
) -> Float[np.ndarray, "5 p"]:
    """Return what the beams of one scan, off lines by `across` m, say of a break at each place along a wall.

    The model is across = a + b along + step [along > place] + turn max(along - place, 0). The wall's offset a and slope
    b, of which the errors of pose and line are part, are eliminated. The five sums are the information on (step, turn),
    as (ss, st, tt), and the information vector (s, t); all 0 where too few beams lie on either side.
    Beams, and places, are given wall by wall in ascending order.
    """
    sums = np.zeros((5, len(places)))
    start, stop, p = 0, 0, 0
    while p < len(places):
        while stop < len(of) and of[stop] <= place_of[p]:
            start = start if of[stop] == of[start] else stop
            stop += 1
        middle, wall = 0.5 * (along[start] + along[stop - 1]), place_of[p]
        t0, t1, t2, f0, f1 = 0.0, 0.0, 0.0, 0.0, 0.0
        for k in range(start, stop):
            x, weight = along[k] - middle, 1.0 / (sigma[k] * sigma[k])
            t0, t1, t2 = t0 + weight, t1 + weight * x, t2 + weight * x * x
            f0, f1 = f0 + weight * across[k], f1 + weight * x * across[k]
        det = t0 * t2 - t1 * t1
        w0, w1, w2, e0, e1, beyond = t0, t1, t2, f0, f1, start
        while p < len(places) and place_of[p] == wall:
            s = places[p] - middle
            while beyond < stop and along[beyond] - middle <= s:
                x, weight = along[beyond] - middle, 1.0 / (sigma[beyond] * sigma[beyond])
                w0, w1, w2 = w0 - weight, w1 - weight * x, w2 - weight * x * x
                e0, e1 = e0 - weight * across[beyond], e1 - weight * x * across[beyond]
                beyond += 1
            if min(stop - beyond, beyond - start) >= LEAST_BEAMS and det > TINY:
                h0, h1, hh, he = w1 - s * w0, w2 - s * w1, w2 - 2.0 * s * w1 + s * s * w0, e1 - s * e0
                # How a step, and a turn, look like an offset and a slope.
                a0, b0 = (t2 * w0 - t1 * w1) / det, (t0 * w1 - t1 * w0) / det
                a1, b1 = (t2 * h0 - t1 * h1) / det, (t0 * h1 - t1 * h0) / det
                sums[0, p], sums[1, p] = w0 - a0 * w0 - b0 * w1, h0 - a0 * h0 - b0 * h1
                sums[2, p] = hh - a1 * h0 - b1 * h1
                sums[3, p], sums[4, p] = e0 - a0 * f0 - b0 * f1, he - a1 * f0 - b1 * f1
            p += 1
    return sums


@compiled
def keep_surest(
    sums: Float[np.ndarray, "5 p"], begin: int, pitch_m: float, least_ratio: float, broken: Float[np.ndarray, "5"]
) -> None:
    """Keep the likeliest break, where it is likely enough: its place m, step m and turn rad, and what was seen, m."""
    broken[:] = 0.0
    at, step, turn, ratio = surest(sums, least_ratio)
    if ratio > least_ratio:
        broken[0], broken[1], broken[2] = pitch_m * (begin + at), step, turn
        broken[3], broken[4] = pitch_m * begin, pitch_m * (begin + sums.shape[1] - 1)


@compiled
def surest(sums: Float[np.ndarray, "5 p"], least_ratio: float) -> tuple[int, float, float, float]:
    """Return where the likeliest break lies, its step m and turn rad, and its likelihood ratio.

    That is by how much the squared residuals of all beams, in their variances, are less with the break. It has a step
    and a turn only if one alone leaves more than `least_ratio` of that: a turn that nothing tells would put far ends
    of the wall far off its line.
    """
    best, best_step, best_turn, best_ratio = 0, 0.0, 0.0, 0.0
    for p in range(sums.shape[1]):
        ss, st, tt = sums[0, p], sums[1, p], sums[2, p]
        det = ss * tt - st * st
        if det > SAME * ss * tt:
            step, turn = (tt * sums[3, p] - st * sums[4, p]) / det, (ss * sums[4, p] - st * sums[3, p]) / det
            ratio = step * sums[3, p] + turn * sums[4, p]
            if ratio > best_ratio:
                best, best_step, best_turn, best_ratio = p, step, turn, ratio
    if best_ratio > 0.0:
        of_step, of_turn = sums[3, best] ** 2 / sums[0, best], sums[4, best] ** 2 / sums[2, best]
        if best_ratio - max(of_step, of_turn) <= least_ratio:
            is_step = of_step >= of_turn
            best_step = sums[3, best] / sums[0, best] if is_step else 0.0
            best_turn = 0.0 if is_step else sums[4, best] / sums[2, best]
    return best, best_step, best_turn, best_ratio


@compiled
def faces_off(
    broken: Float[np.ndarray, "n 5"], extents: Float[np.ndarray, "n 2"]
) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 2"], Bool[np.ndarray, " n"]]:
    """Return the `misfits` of walls, over what their lines were drawn, and which are broken between their ends.

    What beams have shown beyond their extents drew the line, too: a wall that ends at its bend now was seen past it
    before.
    """
    drawn, crooked = np.empty((len(broken), 2)), np.empty(len(broken), np.bool_)
    for k in range(len(broken)):
        drawn[k, 0], drawn[k, 1] = min(extents[k, 0], broken[k, 3]), max(extents[k, 1], broken[k, 4])
        is_broken = broken[k, 1] != 0.0 or broken[k, 2] != 0.0
        crooked[k] = is_broken and extents[k, 0] < broken[k, 0] < extents[k, 1]
    return misfits(broken, drawn), drawn, crooked


@compiled
def misfits(broken: Float[np.ndarray, "n b"], extents: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
    """Return how far the faces of walls are off the lines through them, as variances across, m^2.

    A face is off the line through both by twice the root mean square of what both are, anywhere along the wall.
    """
    found = np.zeros(len(broken))
    for k in range(len(broken)):
        place, step, turn = broken[k, 0], broken[k, 1], broken[k, 2]
        half = 0.5 * (extents[k, 1] - extents[k, 0])
        s = place - 0.5 * (extents[k, 0] + extents[k, 1])
        if (step != 0.0 or turn != 0.0) and half > 0.0 and abs(s) < half:
            w0, w1, w2 = half - s, 0.5 * (half * half - s * s), (half**3 - s**3) / 3.0
            h0, h1, hh = w1 - s * w0, w2 - s * w1, w2 - 2.0 * s * w1 + s * s * w0
            t0, t2 = 2.0 * half, 2.0 * half**3 / 3.0
            a0, b0, a1, b1 = w0 / t0, w1 / t2, h0 / t0, h1 / t2
            ss, st, tt = w0 - a0 * w0 - b0 * w1, h0 - a0 * h0 - b0 * h1, hh - a1 * h0 - b1 * h1
            found[k] = 4.0 * (step * step * ss + 2.0 * step * turn * st + turn * turn * tt) / t0
    return found
