"""Which gaps between two walls beams have passed through: there a way leads on, and no short face was missed."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from .geometry.poses import J
from .robot import Scan
from .stochastic_map import StochasticMap


@dataclass(frozen=True)
class GapsConfig:
    """When a gap counts as passed."""

    least_m: float = 0.15
    """Narrower gaps are not watched: ends are known no better."""
    widest_m: float = 0.35
    """Nor are gaps too wide to be joined at all."""
    beyond_m: float = 0.15
    """A beam passes a gap if it goes on this far beyond it, ..."""
    margin_m: float = 0.04
    """... this far from the two ends."""
    beams: int = 2
    """So many beams of one scan are needed."""


class Gaps:
    """Remembers (wall whose head, wall whose tail) bounds a gap that beams went through."""

    def __init__(self, config: GapsConfig = GapsConfig()) -> None:
        self._config = config
        self.passed: set[tuple[int, int]] = set()

    def see(self, walls: StochasticMap, scan: Scan) -> None:
        """Hold one scan, taken at the map's pose, against the gaps of all firm walls within its range."""
        config, pose = self._config, walls.belief.pose_world
        rows = np.flatnonzero(~walls.tentative & (walls.distances_m < scan.range_max_m + config.widest_m))
        tails, heads = walls.ends_world[rows].transpose(1, 0, 2)
        width = np.hypot(*np.moveaxis(heads[:, None] - tails, -1, 0))
        is_gap = (width > config.least_m) & (width <= config.widest_m) & ~np.eye(len(rows), dtype=bool)
        is_gap &= np.hypot(*(heads - pose[:2]).T)[:, None] < scan.range_max_m
        pairs = np.argwhere(is_gap)
        if not len(pairs):
            return
        beams = passing(heads[pairs[:, 0]], tails[pairs[:, 1]], pose, scan, config.beyond_m, config.margin_m)
        through = pairs[np.count_nonzero(beams, axis=1) >= config.beams]
        self.passed.update((int(head), int(tail)) for head, tail in walls.ids[rows][through].tolist())


def passing(
    from_world: Float[np.ndarray, "g 2"],
    to_world: Float[np.ndarray, "g 2"],
    pose_world: Float[np.ndarray, "3"],
    scan: Scan,
    beyond_m: float,
    margin_m: float,
) -> Bool[np.ndarray, "g k"]:
    """Return which beams cross the straight way between two points, away from both, and go on beyond it."""
    bearing = pose_world[2] + scan.bearings_rad
    beam = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    ranges = np.where(np.isfinite(scan.ranges_m), scan.ranges_m, scan.range_max_m)
    gap, start = to_world - from_world, from_world - pose_world[:2]
    width = np.hypot(gap[:, 0], gap[:, 1])
    # p + s beam = from + u gap; with J the quarter turn, x·(J y) = 0 for x parallel to y.
    denominator = gap @ (beam @ J.T).T
    crossing = np.abs(denominator) > 1e-9
    safe = np.where(crossing, denominator, 1.0)
    u = -(start @ (beam @ J.T).T) / safe
    s = -np.vecdot(start, gap @ J.T)[:, None] / safe
    margin = (margin_m / np.maximum(width, 1e-9))[:, None]
    return crossing & (u > margin) & (u < 1.0 - margin) & (s > 0) & (ranges > s + beyond_m)
