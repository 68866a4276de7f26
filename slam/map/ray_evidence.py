"""What each beam says about each wall: it ends on the wall, passes through where the wall should be, or cannot tell."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ..geometry.lines import directions, normals
from ..robot import Scan

GRAZING_COSINE = 0.05
"""Beams within three degrees of a line say nothing about it: its own uncertainty moves the crossing by metres."""
NEAREST_M = 0.02
"""Nor do those to a line through the robot itself."""


@dataclass(frozen=True)
class RayEvidence:
    """Beams against walls."""

    along: Float[np.ndarray, "n k"]
    """Where each beam crosses each line, m from the anchor; NaN where it does not."""
    hits: Bool[np.ndarray, "n k"]
    """The beam ends on the line."""
    passes: Bool[np.ndarray, "n k"]
    """The beam goes on beyond the line: there is no wall where it crosses."""


def ray_evidence(
    scan: Scan,
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
    margin_m: float,
) -> RayEvidence:
    """Compare a scan with lines (alpha, d) about anchors, world frame; `margin_m` is across the line."""
    n = normals(means[:, 0])
    to_anchor = anchors - pose_world[:2]
    r = means[:, 1] + np.vecdot(n, to_anchor)
    off_normal = scan.bearings_rad + pose_world[2] - means[:, :1]
    cosine = np.cos(off_normal)
    ahead = (cosine > GRAZING_COSINE) & (r[:, None] > NEAREST_M)
    safe = np.where(ahead, cosine, 1.0)
    distance = r[:, None] / safe
    foot = np.vecdot(directions(means[:, 0]), -to_anchor)
    along = np.where(ahead, foot[:, None] + distance * np.sin(off_normal), np.nan)
    across = (scan.passed_m - distance) * safe
    returned = np.isfinite(scan.ranges_m)
    hits = ahead & returned & (np.abs(across) <= margin_m)
    passes = ahead & (across > margin_m)
    return RayEvidence(along, hits, passes)
