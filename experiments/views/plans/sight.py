"""What faces what: straight lines from each wall, to the first wall that they meet."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.lines import normals

from .faces import Faces

STEP_M = 0.1
"""Distance between neighbouring lines of sight."""
OFF_M = 1e-3
"""They begin so far from their own wall."""
BLOCK = 2_000
FACING_RAD = float(np.deg2rad(3.0))
"""Two walls are parallel if their directions differ by no more, and are not known to differ."""
NOTHING = -1


@dataclass(frozen=True)
class Pair:
    """Two parallel walls with nothing in between."""

    first: int
    second: int
    """Rows."""
    at_world: Float[np.ndarray, "2"]
    """In the middle of what faces each other, m."""
    overlap_m: float


def first_hits(
    origins: Float[np.ndarray, "m 2"], along: Float[np.ndarray, "m 2"], segments: Float[np.ndarray, "n 2 2"]
) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, " m"]]:
    """Return the segment that each ray meets first, `NOTHING` for none, and how far away, m."""
    hit, far = np.full(len(origins), NOTHING), np.full(len(origins), np.inf)
    if not len(segments):
        return hit, far
    start, side = segments[:, 0], segments[:, 1] - segments[:, 0]
    for low in range(0, len(origins), BLOCK):
        part = slice(low, low + BLOCK)
        ray, gap = along[part, None], start[None] - origins[part, None]
        across = ray[..., 0] * side[:, 1] - ray[..., 1] * side[:, 0]
        safe = np.where(np.abs(across) < 1e-12, np.nan, across)
        distance = (gap[..., 0] * side[:, 1] - gap[..., 1] * side[:, 0]) / safe
        share = (gap[..., 0] * ray[..., 1] - gap[..., 1] * ray[..., 0]) / safe
        distance = np.where((distance > 0.0) & (share >= 0.0) & (share <= 1.0), distance, np.inf)
        hit[part], far[part] = distance.argmin(axis=1), distance.min(axis=1)
    return np.where(np.isfinite(far), hit, NOTHING), far


def facing(faces: Faces, least_m: float, most_m: float, overlap_m: float, behind: bool = False) -> list[Pair]:
    """Return the pairs of parallel walls that see each other across free floor, or that stand back to back (`behind`).

    Walls shorter than `least_m` are left out; pairs are no farther apart than `most_m`.
    """
    sign = 1.0 if behind else -1.0
    walls = np.flatnonzero(faces.lengths_m >= least_m)
    counts = np.maximum(np.ceil(faces.lengths_m[walls] / STEP_M).astype(int), 3)
    row = np.repeat(walls, counts)
    share = np.concatenate([(np.arange(count) + 0.5) / count for count in counts]) if len(walls) else np.zeros(0)
    ends = faces.ends_world[row]
    at = ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0])
    across = sign * normals(faces.means[row, 0])
    hit, far = first_hits(at + OFF_M * across, across, faces.ends_world)
    step = faces.lengths_m[row] / np.repeat(counts, counts)
    found = []
    good = (hit != NOTHING) & (far <= most_m)
    for first, second in sorted({(int(a), int(b)) for a, b in zip(row[good], hit[good], strict=True) if a < b}):
        mine = good & (row == first) & (hit == second)
        if faces.lengths_m[second] < least_m or step[mine].sum() < overlap_m or not parallel(faces, first, second):
            continue
        middle = at[mine].mean(axis=0) + 0.5 * float(far[mine].mean()) * across[mine][0]
        found.append(Pair(first, second, middle, float(step[mine].sum())))
    return found


def parallel(faces: Faces, first: int, second: int) -> bool:
    """Return whether two walls look in opposite directions, as far as their directions are known."""
    alpha = faces.means[[first, second], 0]
    return bool(np.cos(alpha[0] - alpha[1]) < -np.cos(FACING_RAD))
