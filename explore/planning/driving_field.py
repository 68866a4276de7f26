"""How far it is to drive from one place to everywhere else, from one search over blocks of cells."""

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from jaxtyping import Bool, Float, Int
from skimage.graph import MCP_Geometric

from chainslam.slam.geometry.lines import normals
from chainslam.slam.robot import RobotSpec

from ..floor.free_space import FreeSpace
from .grid_kernels import block_cells, blocks_with_any, metres_from
from .passable import PathConfig, passable, roomy

DIRECTIONS = 16
"""Places on a ring."""
NEAR_M = 8.0
"""The search goes so far first; most of what is asked for is nearer, and a whole building costs far more."""


@dataclass(frozen=True)
class _Reach:
    """What one search found."""

    first_block: Int[np.ndarray, "2"]
    """The block of the whole grid at which `metres` begins, less the border."""
    metres: Float[np.ndarray, "p q"]
    """Length of the shortest way to each block, with a border of blocks out of reach, which saves bounds checks."""


class DrivingField:
    """Lengths of the shortest ways from one place over floor that was seen free, good to about a block.

    It searches when it is asked, so ask before the floor changes.
    """

    def __init__(self, free_space: FreeSpace, start_world: Float[np.ndarray, "2"], config: PathConfig) -> None:
        """Search from `start_world`."""
        self._free_space, self._config = free_space, config
        self._block = block_cells(config.robot.half_width_m, free_space.config.cell_m)
        self._side_m = self._block * free_space.config.cell_m
        blocks = -(-np.array(free_space.shape) // self._block)
        self._start = np.clip(free_space.cells(start_world[None])[0] // self._block, 0, blocks - 1)

    def metres(self, places_world: Float[np.ndarray, "n 2"], beyond_nearest: bool = True) -> Float[np.ndarray, " n"]:
        """Return how far it is to drive to each place (within a block of it), m; infinite where no way is known.

        Without `beyond_nearest` only the least is wanted: any other may be infinite, too, which is much cheaper.
        """
        if "_far" in self.__dict__:
            return self._lookup(self._far, places_world)
        metres = self._lookup(self._near, places_world)
        metres[metres > NEAR_M] = np.inf
        known = np.isfinite(metres)
        if known.all() or (known.any() and not beyond_nearest):
            return metres
        return self._lookup(self._far, places_world)

    def can_stay(self, cells: Int[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Return in which cells (row, column of the grid) the robot's centre may stay, and can get to."""
        at, reach = tuple(cells.T), self._far
        free, clearance = self._free_space.evidence[at] < 0, self._free_space.clearance()[at]
        block = np.clip(cells // self._block - reach.first_block, -1, np.array(reach.metres.shape) - 2) + 1
        return roomy(free, clearance, self._config) & np.isfinite(reach.metres[tuple(block.T)])

    @property
    def robot(self) -> RobotSpec:
        """Whose body it is that drives."""
        return self._config.robot

    def _box_of_cells(self, reach: int) -> tuple[slice, slice]:
        """Return the cells of the blocks up to `reach` from the start in rows and columns."""
        low, high = self._block * np.maximum(self._start - reach, 0), self._block * (self._start + reach + 1)
        return slice(low[0], high[0]), slice(low[1], high[1])

    def stands_around(
        self, places_world: Float[np.ndarray, "n 2"], metres: Float[np.ndarray, " k"]
    ) -> Float[np.ndarray, "m 2"]:
        """Return where the robot's centre may stay on rings around some places, m; the rings' radii are `metres`."""
        angle = 2 * np.pi * np.arange(DIRECTIONS) / DIRECTIONS
        around = (metres[:, None, None] * normals(angle)).reshape(-1, 2)
        stands = (places_world[:, None] + around).reshape(-1, 2)
        cells = self._free_space.cells(stands)
        inside = self._free_space.inside(cells)
        return stands[inside][self.can_stay(cells[inside])]

    @cached_property
    def _near(self) -> _Reach:
        return self._search(int(np.ceil(NEAR_M / self._side_m)) + 1)

    @cached_property
    def _far(self) -> _Reach:
        return self._search(max(self._free_space.shape))

    def _search(self, reach: int) -> _Reach:
        """Search as far as `reach` blocks from the start in rows and columns."""
        first = np.maximum(self._start - reach, 0)
        blocks = blocks_with_any(passable(self._free_space, self._box_of_cells(reach), self._config)[0], self._block)
        start = self._start - first
        starts = start[None]
        if not blocks[tuple(start)]:
            # Too near to a wall: it gets away to what is passable around it, as paths do.
            blocks[tuple(start)] = True
            away = int(np.ceil(self._config.escape_m / self._side_m))
            starts = np.argwhere(blocks[_box(start, away)]) + np.maximum(start - away, 0)
        lengths, _ = MCP_Geometric(np.where(blocks, 1.0, -1.0)).find_costs([tuple(b) for b in starts.tolist()])
        return _Reach(first, np.pad(lengths * self._side_m, 1, constant_values=np.inf))

    def _lookup(self, reach: _Reach, places_world: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, " n"]:
        places = (places_world - self._free_space.origin_world)[:, ::-1] / self._side_m - reach.first_block
        return metres_from(reach.metres, places, self._side_m)


def _box(centre: np.ndarray, reach: int) -> tuple[slice, slice]:
    low, high = np.maximum(centre - reach, 0), centre + reach + 1
    return slice(low[0], high[0]), slice(low[1], high[1])
