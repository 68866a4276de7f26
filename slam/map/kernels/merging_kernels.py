"""Which landmarks lie along each other: the loops of `merging`."""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ...geometry.compiled import compiled


@compiled
def lying_along(
    ids: Int[np.ndarray, " n"],
    touched: Int[np.ndarray, " m"],
    tentative: Bool[np.ndarray, " n"],
    means: Float[np.ndarray, "n 2"],
    ends: Float[np.ndarray, "n 2 2"],
    extents: Float[np.ndarray, "n 2"],
    turn_cosine: float,
    across_m: float,
) -> tuple[Int[np.ndarray, "p 2"], Float[np.ndarray, "p 3"]]:
    """Return the rows of trusted walls that lie along each other, one of them among those of ids `touched`, ascending.

    And the length of the shorter of each two, how far it lies across the longer, and by how much they overlap, m.
    """
    n, alpha, lengths = len(means), means[:, 0], extents[:, 1] - extents[:, 0]
    is_ours = np.zeros(n, np.bool_)
    for wall in touched:
        row = np.searchsorted(ids, wall)
        if row < n and ids[row] == wall:
            is_ours[row] = True
    ours, everyone = np.flatnonzero(is_ours), np.arange(n)
    pairs, beside, count = np.empty((8, 2), np.int64), np.empty((8, 3)), 0
    for older in range(n):
        for younger in everyone[older + 1 :] if is_ours[older] else ours:
            if younger <= older or tentative[older] or tentative[younger]:
                continue
            # Circles around two walls that lie along each other meet: this leaves few pairs to look at.
            x = 0.5 * (ends[older, 0, 0] + ends[older, 1, 0] - ends[younger, 0, 0] - ends[younger, 1, 0])
            y = 0.5 * (ends[older, 0, 1] + ends[older, 1, 1] - ends[younger, 0, 1] - ends[younger, 1, 1])
            reach = 0.5 * (lengths[older] + lengths[younger]) + across_m
            if x * x + y * y > reach * reach or math.cos(alpha[older] - alpha[younger]) <= turn_cosine:
                continue
            is_shorter = lengths[older] <= lengths[younger]
            shorter, longer = (older, younger) if is_shorter else (younger, older)
            across, overlap = _beside(ends[shorter], ends[longer], alpha[longer], lengths[longer])
            if across <= across_m and overlap >= across_m:
                if count == len(pairs):
                    pairs = np.concatenate((pairs, np.empty((count, 2), np.int64)))
                    beside = np.concatenate((beside, np.empty((count, 3))))
                pairs[count, 0], pairs[count, 1] = older, younger
                beside[count, 0], beside[count, 1], beside[count, 2] = lengths[shorter], across, overlap
                count += 1
    return pairs[:count].copy(), beside[:count].copy()


@compiled
def _beside(
    shorter: Float[np.ndarray, "2 2"], longer: Float[np.ndarray, "2 2"], alpha: float, length: float
) -> tuple[float, float]:
    """Return how far one wall lies across the line of another, m, and by how much they overlap along it.

    By so much one would have to slide until they part: their overlap, or more where one lies amid the other.
    """
    nx, ny, across = math.cos(alpha), math.sin(alpha), 0.0
    along = np.empty(2)
    for end in range(2):
        x, y = shorter[end, 0] - longer[0, 0], shorter[end, 1] - longer[0, 1]
        across = max(across, abs(nx * x + ny * y))
        along[end] = nx * y - ny * x
    return across, min(length - along[0], along[1])
