"""Which gaps between two walls beams have passed through: there a way leads on, and no short face was missed.

And which corners they have cut off: where two walls would meet if both went on, there is none.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..geometry.lines import intersect
from ..geometry.poses import J
from ..robot import Scan
from .chains import ChainConfig
from .records import Records
from .stochastic_map import StochasticMap


@dataclass(frozen=True)
class OpeningsConfig:
    """When a gap counts as passed."""

    beyond_m: float = 0.15
    """A beam passes a gap if it goes on this far beyond it, ... Narrower gaps are not watched, since ends are known no
    better; nor are those that no chain would join."""
    margin_m: float = 0.04
    """... this far from the two ends. Beams cut a corner off that cross what is supposed of either wall, so far from
    its ends, and reach as far behind it, across the wall: four sigmas of a beam."""
    beams: int = 2
    """So many beams of one scan are needed."""


class Openings:
    """Remembers (wall whose head, wall whose tail) bounds a gap that beams went through."""

    def __init__(self, config: OpeningsConfig, chains: ChainConfig, records: Records | None = None) -> None:
        self._config, self._chains = config, chains
        self._records = Records() if records is None else records
        self._records.relate("passed", "cut_off")

    @property
    def passed(self) -> set[tuple[int, int]]:
        """Pairs (wall whose head, wall whose tail) that bound a gap through which beams went."""
        return self._records.pairs["passed"]

    @property
    def cut_off(self) -> set[tuple[int, int]]:
        """Pairs that make no corner where their lines cross: beams went through one of the two supposed pieces."""
        return self._records.pairs["cut_off"]

    def see(self, walls: StochasticMap, scan: Scan) -> None:
        """Hold one scan, taken at the map's pose, against gaps and corners of established walls within its range."""
        config, pose = self._config, walls.belief.pose_world
        widest_m = self._chains.set_aside_reach_m
        rows = np.flatnonzero(~walls.tentative & (walls.distances_m < scan.range_max_m + widest_m))
        tails, heads = walls.ends_world[rows].transpose(1, 0, 2)
        width = np.hypot(*np.moveaxis(heads[:, None] - tails, -1, 0))
        is_near = (width <= widest_m) & ~np.eye(len(rows), dtype=bool)
        is_near &= np.hypot(*(heads - pose[:2]).T)[:, None] < scan.range_max_m
        pairs = np.argwhere(is_near)
        gaps = pairs[width[tuple(pairs.T)] > config.beyond_m]
        if len(gaps):
            through = passing(heads[gaps[:, 0]], tails[gaps[:, 1]], pose, scan, config.beyond_m, config.margin_m)
            self.passed.update(self._pairs(walls.ids[rows], gaps, through))
        lines = walls.belief.lines_world[rows]
        corners, parallel = intersect(lines[pairs[:, 0]], lines[pairs[:, 1]])
        pieces = np.stack([corners - heads[pairs[:, 0]], tails[pairs[:, 1]] - corners])
        lengths = np.hypot(pieces[..., 0], pieces[..., 1])
        supposed = ~parallel & np.all(lengths <= self._chains.corner_reach_m, axis=0)
        supposed &= np.any(lengths > 2.0 * config.margin_m, axis=0)
        # Ends that have come to meet where the lines cross suppose nothing any more.
        self.cut_off.difference_update((int(h), int(t)) for h, t in walls.ids[rows][pairs[~supposed]].tolist())
        pairs, corners = pairs[supposed], corners[supposed]
        if len(pairs):
            ends = ((heads[pairs[:, 0]], corners), (corners, tails[pairs[:, 1]]))
            beams = [passing(*piece, pose, scan, 0.0, config.margin_m, config.margin_m) for piece in ends]
            self.cut_off.update(self._pairs(walls.ids[rows], pairs, beams[0] | beams[1]))

    def _pairs(
        self, ids: Int[np.ndarray, " n"], pairs: Int[np.ndarray, "g 2"], beams: Bool[np.ndarray, "g k"]
    ) -> list[tuple[int, int]]:
        """Return the ids of the pairs of rows that beams enough have passed."""
        through = pairs[np.count_nonzero(beams, axis=1) >= self._config.beams]
        return [(int(head), int(tail)) for head, tail in ids[through].tolist()]


def passing(
    from_world: Float[np.ndarray, "g 2"],
    to_world: Float[np.ndarray, "g 2"],
    pose_world: Float[np.ndarray, "3"],
    scan: Scan,
    beyond_m: float,
    margin_m: float,
    across_m: float = 0.0,
) -> Bool[np.ndarray, "g k"]:
    """Return which beams cross the straight way between two points, away from both, and go on beyond it.

    So far along the beam, and so far across the way.
    """
    bearing = pose_world[2] + scan.bearings_rad
    beam = np.stack([np.cos(bearing), np.sin(bearing)], axis=-1)
    gap, start = to_world - from_world, from_world - pose_world[:2]
    width = np.hypot(gap[:, 0], gap[:, 1])
    # p + s beam = from + u gap; with J the quarter turn, x·(J y) = 0 for x parallel to y.
    denominator = gap @ (beam @ J.T).T
    crossing = np.abs(denominator) > 1e-9
    safe = np.where(crossing, denominator, 1.0)
    u = -(start @ (beam @ J.T).T) / safe
    s = -np.vecdot(start, gap @ J.T)[:, None] / safe
    sine = np.abs(denominator) / np.maximum(width, 1e-9)[:, None]
    margin = (margin_m / np.maximum(width, 1e-9))[:, None]
    return (
        crossing
        & (u > margin)
        & (u < 1.0 - margin)
        & (s > 0)
        & (scan.passed_m > s + beyond_m + across_m / np.maximum(sine, 1e-9))
    )
