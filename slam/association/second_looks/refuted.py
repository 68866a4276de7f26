"""Walls that came and went: scans from which more beams passed through where one stood than ended on it."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from ...estimation.mounting import scanner_poses
from ...map.kernels.ray_evidence import ray_evidence
from ...robot import Scan, ScannerSpec
from .solve import Unknowns


@dataclass(frozen=True)
class Rays:
    """All scans of a drive, and where their scanner sits on the robot."""

    scans: Sequence[Scan] = ()
    scanner: ScannerSpec = field(default_factory=ScannerSpec)


NO_RAYS = Rays()


def refuted(at: Unknowns, reach: Float[np.ndarray, "l 2"], rays: Rays, margin_m: float) -> Bool[np.ndarray, " l"]:
    """Return which lines more scans speak against than for."""
    pro, contra = voted(at, reach, rays, margin_m)
    return contra > pro


def voted(
    at: Unknowns, reach: Float[np.ndarray, "l 2"], rays: Rays, margin_m: float
) -> tuple[Int[np.ndarray, " l"], Int[np.ndarray, " l"]]:
    """Return how many scans speak for each line, and how many against it.

    A scan speaks for a line if more of its beams end within a margin of it, along its reach, than go on beyond it.
    Beams that end before it say nothing, nor do those beside its ends.
    """
    pro, contra = np.zeros((2, len(at.lines)), dtype=np.int64)
    for scan, pose in zip(rays.scans, scanner_poses(at.poses, rays.scanner), strict=False):
        seen = ray_evidence(scan, pose, at.anchors, at.lines)
        inside = seen.between(reach, margin_m)
        ended, passed = (np.count_nonzero(x & inside, axis=1) for x in (seen.hits(margin_m), seen.passes(margin_m)))
        pro += ended > passed
        contra += passed > ended
    return pro, contra
