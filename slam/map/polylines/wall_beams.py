"""Where the beams of one scan meet the walls that its segments belong to: what evidence of all scans is made of."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import Belief
from ...estimation.shared import SharedConfig
from ...extraction.segments import Segments
from ...robot import Scan
from .kernels.change_point_kernels import beams_on_lines, feet_along

Sums = tuple[int, Float[np.ndarray, "q _"]]
"""The number of the first place along a wall, and q sums of each from there on."""


@dataclass(frozen=True)
class WallBeams:
    """The beams of m segments, in the order of the segments; the first and the last of each are left out."""

    segments: Int[np.ndarray, " m"]
    """Rows in the scan's segments."""
    walls: Int[np.ndarray, " m"]
    """Ids."""
    lines: Float[np.ndarray, "m 2"]
    """(alpha, r) as seen, robot frame."""
    feet: Float[np.ndarray, " m"]
    """Where the robot's perpendicular meets each line, m along its wall."""
    along: Float[np.ndarray, " k"]
    """Where beams meet the lines, m along their walls."""
    across: Float[np.ndarray, " k"]
    """By how much they miss them, m."""
    sigma: Float[np.ndarray, " k"]
    """Of that, m."""
    of: Int[np.ndarray, " k"]
    """The segment of each beam, 0 to m - 1."""


def beams_on_walls(
    belief: Belief, scan: Scan, segments: Segments, pairs: Int[np.ndarray, "m 2"], shared: SharedConfig
) -> WallBeams:
    """Return where beams meet walls; `pairs` are (segment, wall id)."""
    rows, lines = belief.rows(pairs[:, 1]), segments.lines[pairs[:, 0]]
    feet = feet_along(lines, belief.pose_world, belief.anchors[rows], belief.means[rows, 0])
    beams = scan.bearings_rad, scan.ranges_m, np.ascontiguousarray(scan.sigmas_m)
    met = beams_on_lines(segments.beams[pairs[:, 0]], lines, feet, *beams, float(shared.noise_sigmas))
    return WallBeams(pairs[:, 0], pairs[:, 1], lines, feet, *met)


def with_more(kept: Sums | None, first: int, more: Float[np.ndarray, "q _"]) -> Sums:
    """Return sums at places along a wall, and the number of the first; `more` are of those from `first` on."""
    begin, sums = kept or (first, more[:, :0])
    before, after = max(begin - first, 0), max(first + more.shape[1] - begin - sums.shape[1], 0)
    if before or after:
        begin, sums = begin - before, np.pad(sums, ((0, 0), (before, after)))
    sums[:, first - begin : first - begin + more.shape[1]] += more
    return begin, sums
