"""Pieces of a drive as sets of points: the scans of a few metres, laid together by their poses."""

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Float
from scipy.spatial import cKDTree

from ...geometry.poses import to_robot, to_world
from ...odometry.point_kernels import joined, thinned
from .config import ClosuresConfig


@dataclass(frozen=True)
class Returns:
    """The returns of all scans, robot frame, in the order of their beams."""

    points: Sequence[Float[np.ndarray, "_ 2"]]
    config: ClosuresConfig

    @cached_property
    def surfaces(self) -> list[np.ndarray]:
        """The points of each with others between neighbours on one surface, thinned to cells."""
        c = self.config
        return [thinned(joined(each, c.place.cell_m, c.gap_m), 0.5 * c.place.cell_m) for each in self.points]

    def seen_from(self, scans: range, poses: Float[np.ndarray, "s 3"], of: int) -> Float[np.ndarray, "n 2"]:
        """Return the returns of some scans in the frame of one scan, thinned to cells."""
        world = np.concatenate([to_world(self.points[k], poses[k]) for k in scans])
        return thinned(to_robot(world, poses[of]), self.config.place.cell_m)

    def surface(self, scans: range, poses: Float[np.ndarray, "s 3"]) -> Float[np.ndarray, "n 2"]:
        """Return the surfaces of some scans in the world frame, thinned to half cells."""
        return thinned(
            np.concatenate([to_world(self.surfaces[k], poses[k]) for k in scans]), 0.5 * self.config.place.cell_m
        )

    def fit(self, scan: int, before: range, poses: Float[np.ndarray, "s 3"]) -> float:
        """Return the share of a scan's returns that lie near some of the scans before; 1 where there is none."""
        earlier = [to_world(self.surfaces[k], poses[k]) for k in before if len(self.points[k])]
        if not earlier or not len(self.points[scan]):
            return 1.0
        away, _ = cKDTree(np.concatenate(earlier)).query(
            to_world(self.points[scan], poses[scan]), distance_upper_bound=2.0 * self.config.place.cell_m
        )
        return float(np.isfinite(away).mean())
