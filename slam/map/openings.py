"""Which gaps between two walls beams have passed through: there a way leads on, and no short face was missed.

And which corners they have cut off: where two walls would meet if both went on, there is none.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..robot import Scan
from .chains import ChainConfig
from .kernels import ray_kernels
from .kernels.chain_kernels import HEAD, TAIL, near_ends, supposed_corners
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
        ends, ids = walls.ends_world[rows], walls.ids[rows]
        tails, heads = ends[:, TAIL], ends[:, HEAD]
        pairs = near_ends(ends, float(widest_m))
        from_robot, width = heads - pose[:2], tails[pairs[:, 1]] - heads[pairs[:, 0]]
        is_near = np.hypot(from_robot[:, 0], from_robot[:, 1])[pairs[:, 0]] < scan.range_max_m
        pairs, width = pairs[is_near], width[is_near]
        gaps = pairs[np.hypot(width[:, 0], width[:, 1]) > config.beyond_m]
        if len(gaps):
            through = passing(heads[gaps[:, 0]], tails[gaps[:, 1]], pose, scan, config.beyond_m, config.margin_m)
            self.passed.update(self._pairs(ids, gaps, through))
        lines, reach = walls.belief.lines_world[rows], float(self._chains.corner_reach_m)
        corners, supposed = supposed_corners(pairs, ends, lines, reach, 2.0 * config.margin_m)
        if self.cut_off:
            # Ends that have come to meet where the lines cross suppose nothing any more.
            self.cut_off.difference_update((h, t) for h, t in ids[pairs[~supposed]].tolist())
        pairs, corners = pairs[supposed], corners[supposed]
        if len(pairs):
            limits = pose, scan, 0.0, config.margin_m, config.margin_m
            before = passing(heads[pairs[:, 0]], corners, *limits)
            after = passing(corners, tails[pairs[:, 1]], *limits)
            self.cut_off.update(self._pairs(ids, pairs, before | after))

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
    beams = scan.bearings_rad, scan.passed_m
    return ray_kernels.passing(
        from_world, to_world, pose_world, *beams, float(beyond_m), float(margin_m), float(across_m)
    )
