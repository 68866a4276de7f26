"""How far it is to drive from one place to everywhere else, from one search over blocks of cells."""

import numpy as np
from jaxtyping import Bool, Float
from skimage.graph import MCP_Geometric

from .free_space import FreeSpace
from .paths import PathConfig, costs

BLOCK = 4
"""Cells on each side of a block: 0.2 m. The body's clearance on both sides of a wall is wider than that, so no block
reaches through one."""


class DrivingField:
    """Lengths of the shortest ways from one place over floor that was seen free, good to about a block."""

    def __init__(self, free_space: FreeSpace, start_world: Float[np.ndarray, "2"], config: PathConfig) -> None:
        """Search the whole grid."""
        self._free_space = free_space
        may_fit = free_space.may_fit((slice(None), slice(None)), config.tight_m)
        metre, self._roomy = costs(free_space.evidence < 0, free_space.clearance(), may_fit, config)
        h, w = metre.shape
        padded = np.pad(metre > 0, ((0, -h % BLOCK), (0, -w % BLOCK)))
        # Ten times as fast as any() over a reshaped view.
        rows = np.logical_or.reduce([padded[k::BLOCK] for k in range(BLOCK)])
        blocks = np.logical_or.reduce([rows[:, k::BLOCK] for k in range(BLOCK)])
        self._side_m = BLOCK * free_space.config.cell_m
        start = np.clip(free_space.cells(start_world[None])[0] // BLOCK, 0, np.array(blocks.shape) - 1)
        starts = start[None]
        if not blocks[tuple(start)]:
            # Too near to a wall: it gets away to what is passable around it, as paths do.
            blocks[tuple(start)] = True
            reach = int(np.ceil(config.escape_m / self._side_m))
            starts = np.argwhere(blocks[_box(start, reach)]) + np.maximum(start - reach, 0)
        lengths, _ = MCP_Geometric(np.where(blocks, 1.0, -1.0)).find_costs([tuple(b) for b in starts.tolist()])
        # A border of blocks out of reach saves bounds checks.
        self._metres = np.pad(lengths * self._side_m, 1, constant_values=np.inf)

    def metres(self, places_world: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        """Return how far it is to drive to each place (within a block of it), m; infinite where no way is known."""
        position = (places_world - self._free_space.origin_world)[:, ::-1] / self._side_m
        near = np.clip(np.floor(position).astype(np.int64), -1, np.array(self._metres.shape) - 2)
        best = np.full(len(places_world), np.inf)
        for offset in np.ndindex(3, 3):
            block = np.clip(near + np.array(offset), 0, np.array(self._metres.shape) - 1)
            gap = np.hypot(*(position - (block - 0.5)).T) * self._side_m
            best = np.minimum(best, self._metres[tuple(block.T)] + gap)
        return best

    def reachable(self) -> Bool[np.ndarray, "h w"]:
        """Return which cells of the grid the robot's centre may stay in and can get to."""
        h, w = self._roomy.shape
        finite = np.isfinite(self._metres[1:-1, 1:-1])
        return self._roomy & finite.repeat(BLOCK, axis=0).repeat(BLOCK, axis=1)[:h, :w]


def _box(centre: np.ndarray, reach: int) -> tuple[slice, slice]:
    low, high = np.maximum(centre - reach, 0), centre + reach + 1
    return slice(low[0], high[0]), slice(low[1], high[1])
