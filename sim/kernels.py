"""Ray casting in compiled loops: along a face 1/range is linear in (cos, sin), and the nearest face has the largest.

A face is a column of `rows`: x and y of its start, of its end, the normal of its line and the line's distance.
"""

import math

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.compiled import compiled
from chainslam.slam.geometry.numerics import TINY

_ON_THE_VERTEX = 1e-9
"""Share of a beam step by which faces are extended, so that no beam passes between two faces that touch."""


@compiled
def seen_from(
    rows: Float[np.ndarray, "7 m"], x: float, y: float
) -> tuple[Int[np.ndarray, " s"], Float[np.ndarray, "4 s"], Float[np.ndarray, "2 s"]]:
    """Return which faces are seen from their free side, their ends from the scanner, and normals over distances."""
    seen, count = np.empty(rows.shape[1], np.int64), 0
    ends, inverse = np.empty((4, rows.shape[1])), np.empty((2, rows.shape[1]))
    for k in range(rows.shape[1]):
        distance = rows[6, k] - rows[4, k] * x - rows[5, k] * y
        if distance > 0.0:
            seen[count] = k
            ends[0, count], ends[1, count] = rows[0, k] - x, rows[1, k] - y
            ends[2, count], ends[3, count] = rows[2, k] - x, rows[3, k] - y
            inverse[0, count], inverse[1, count] = rows[4, k] / distance, rows[5, k] / distance
            count += 1
    return seen[:count], ends[:, :count], inverse[:, :count]


@compiled
def nearest(
    bearing: Float[np.ndarray, "2 s"],
    inverse: Float[np.ndarray, "2 s"],
    cos: Float[np.ndarray, " k"],
    sin: Float[np.ndarray, " k"],
    first_rad: float,
    step_rad: float,
    range_max_m: float,
) -> tuple[Float[np.ndarray, " k"], Int[np.ndarray, " k"]]:
    """Return the range of each beam, +inf beyond the maximum, and the face that it meets, -1 for none.

    `bearing` are those of the ends of faces, `cos` and `sin` of the beams, of which the first has the bearing
    `first_rad`. A face may lie across the seam: its beams are sought in this turn and in the one before.
    """
    beams = len(cos)
    best, face = np.full(beams, 1.0 / range_max_m), np.full(beams, -1)
    for turn in range(2):
        for k in range(bearing.shape[1]):
            start = (bearing[0, k] - first_rad) % (2.0 * np.pi)
            stop = start + (bearing[1, k] - bearing[0, k]) % (2.0 * np.pi) - 2.0 * np.pi * turn
            start -= 2.0 * np.pi * turn
            first = max(np.ceil(start / step_rad - _ON_THE_VERTEX), 0.0)
            last = min(np.floor(stop / step_rad + _ON_THE_VERTEX), beams - 1.0)
            for beam in range(int(first), int(last) + 1):
                value = inverse[0, k] * cos[beam] + inverse[1, k] * sin[beam]
                if value >= best[beam]:
                    best[beam], face[beam] = value, k
    ranges = np.full(beams, np.inf)
    for beam in range(beams):
        if face[beam] >= 0:
            ranges[beam] = 1.0 / best[beam]
    return ranges, face


@compiled
def clear_places(
    places: Float[np.ndarray, "n 2"],
    faces: Float[np.ndarray, "m 2 2"],
    radius_m: float,
    people: Float[np.ndarray, "p 2"],
    person_m: float,
) -> int:
    """Return how many places, from the first on, a disc of this radius can be at clear of all faces and people."""
    for n in range(len(places)):
        for (ax, ay), (bx, by) in faces:
            along_x, along_y, x, y = bx - ax, by - ay, places[n, 0] - ax, places[n, 1] - ay
            squared = max(along_x * along_x + along_y * along_y, TINY**2)
            share = min(max((x * along_x + y * along_y) / squared, 0.0), 1.0)
            if math.hypot(x - share * along_x, y - share * along_y) < radius_m:
                return n
        for x, y in people:
            if math.hypot(places[n, 0] - x, places[n, 1] - y) - person_m < radius_m:
                return n
    return len(places)
