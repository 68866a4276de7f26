"""What each beam says about each wall: it ends on the wall, passes through where the wall should be, or cannot tell."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ...robot import Scan
from . import ray_kernels


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
    beams = scan.bearings_rad, scan.ranges_m, scan.passed_m
    return RayEvidence(*ray_kernels.ray_evidence(*beams, pose_world, anchors, means, float(margin_m)))
