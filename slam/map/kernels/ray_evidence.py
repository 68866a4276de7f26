"""What each beam says about each wall: it ends on the wall, passes through where the wall should be, or cannot tell."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ...robot import Scan
from .ray_kernels import crossings, reaching


@dataclass(frozen=True)
class RayEvidence:
    """Beams against walls."""

    along: Float[np.ndarray, "n k"]
    """Where each beam crosses each line, m from the anchor; NaN where it does not."""
    across: Float[np.ndarray, "n k"]
    """How far it goes on beyond the line, m across it, negative where it ends before; NaN where they do not cross."""
    returned: Bool[np.ndarray, " k"]
    """Which beams ended on something."""

    def hits(self, margin_m: float) -> Bool[np.ndarray, "n k"]:
        """Return which beams end on each line."""
        return self.returned & (np.abs(self.across) <= margin_m)

    def passes(self, margin_m: float) -> Bool[np.ndarray, "n k"]:
        """Return which beams go on beyond each line: there is no wall where they cross."""
        return self.across > margin_m

    def between(self, extents: Float[np.ndarray, "n 2"], inside_m: float = 0.0) -> Bool[np.ndarray, "n k"]:
        """Return which beams cross each line between the ends of its wall, by more than so much inside of them."""
        return (extents[:, :1] + inside_m < self.along) & (self.along < extents[:, 1:] - inside_m)

    def reaching(self, extents: Float[np.ndarray, "n 2"], margin_m: float) -> Int[np.ndarray, " n"]:
        """Return how many beams reach each wall between its ends: they end on it, or go on beyond it."""
        return reaching(self.along, self.across, extents, margin_m)


def ray_evidence(
    scan: Scan,
    pose_world: Float[np.ndarray, "3"],
    anchors: Float[np.ndarray, "n 2"],
    means: Float[np.ndarray, "n 2"],
) -> RayEvidence:
    """Compare a scan with lines (alpha, d) about anchors, world frame."""
    found = crossings(scan.bearings_rad, scan.passed_m, pose_world, anchors, means)
    return RayEvidence(*found, np.isfinite(scan.ranges_m))
