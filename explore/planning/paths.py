"""Collision-free paths for the robot's disc over floor that was seen free."""

from copy import copy
from dataclasses import dataclass
from functools import cached_property
from typing import NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import label
from skimage.graph import MCP_Geometric

from ..floor.free_space import FreeSpace
from .grid_kernels import block_cells, blocks_with_any, cells_of, outwards
from .headings import Ground, Room, cheapest
from .passable import PathConfig, blind_blocks, metre_costs, passable

BESIDE_M = 1.0
"""Paths are sought so far to each side of the shortest way by blocks."""
ESCAPE_COST = 30.0
"""What a metre costs where the robot gets away from a wall that it is too near to."""


OUTWARDS_CELLS, OUTWARDS_COST = 3, 8.0
"""So far beyond where the body fits a field goes on, at so much a metre: the robot may stand there, and gets away.

Two walls leave more cells between them in which it does not fit."""


class Field(NamedTuple):
    """How far it is to drive to some places from everywhere around the way there."""

    metres: Float[np.ndarray, "h w k"]
    """By cell and, for a body with an outline, by heading, ahead first; infinite where no way leads."""
    corner_world: Float[np.ndarray, "2"]
    """Where the first cell begins."""
    cell_m: float


@dataclass(frozen=True)
class Path:
    """A way to one of the places asked for."""

    points_world: Float[np.ndarray, "n 2"]
    """Cell centres from the robot to the goal, m."""
    cost: float
    """Length in metres, with what narrow places cost on top."""
    field: Field
    """What is left of the way to any of the places from around it, a metre in a narrow place for more."""


class Planner:
    """Cheapest paths from one place over a free space as it was then, within a window of it."""

    def __init__(
        self,
        free_space: FreeSpace,
        start_world: Float[np.ndarray, "2"],
        config: PathConfig,
        window_m: float | None = None,
        heading_rad: float | None = None,
    ) -> None:
        """Look at the floor within `window_m` of the start in x and y, or at all of it.

        A body with an outline begins with a heading; without one, with any.
        """
        self._heading_rad = heading_rad
        self._free_space, self._config = free_space, config
        self._block = block_cells(config.robot.half_width_m, free_space.config.cell_m)
        start = free_space.cells(start_world[None])[0]
        reach = max(free_space.shape) if window_m is None else int(np.ceil(window_m / free_space.config.cell_m))
        self._corner = np.maximum(start - reach, 0)
        box = (slice(self._corner[0], start[0] + reach + 1), slice(self._corner[1], start[1] + reach + 1))
        self._box = box
        self._passable, self._roomy = passable(free_space, box, config)
        self._clearance = free_space.clearance()[box].copy()
        self._start = start - self._corner
        self._escape = np.zeros_like(self._roomy)
        self._open_start(free_space.is_free(box))

    def to(self, places_world: Float[np.ndarray, "n 2"]) -> Path | None:
        """Return the cheapest path to the cheapest of the places, or None if none can be reached.

        The search keeps to the surroundings of the shortest way by blocks of cells, if it leads through there: the
        path may cost more than the cheapest, if that lies farther off.
        """
        cells = self._free_space.cells(places_world) - self._corner
        usable = np.flatnonzero(np.all((cells >= 0) & (cells < self._passable.shape), axis=1))
        usable = usable[self._passable[tuple(cells[usable].T)]]
        if not len(usable):
            return None
        corridor = self._corridor(cells[usable])
        if corridor is None:
            return None
        # A block may hold cells that do not hang together, so that the way by blocks may be none.
        return self._cheapest(cells[usable], corridor) or self._cheapest(
            cells[usable[self._is_connected[tuple(cells[usable].T)]]], np.ones_like(corridor)
        )

    def _corridor(self, goals: Int[np.ndarray, "g 2"]) -> Bool[np.ndarray, "p q"] | None:
        """Return the blocks around the shortest way to the nearest of some cells; None if no way leads to any."""
        squeezed = np.where(self._passable_blocks, 1.0 + self._config.squeeze_cost, -1.0)
        costs = np.where(self._roomy_blocks, 1.0, squeezed)
        costs[self._blind_blocks & (costs > 0.0)] += self._config.blind_cost
        ends = np.unique(goals // self._block, axis=0)
        search = MCP_Geometric(costs)
        here = tuple(self._start // self._block)
        lengths, _ = search.find_costs([here], [tuple(end) for end in ends], find_all_ends=False)
        at_ends = lengths[tuple(ends.T)]
        best = int(np.argmin(at_ends))
        if not np.isfinite(at_ends[best]):
            return None
        corridor = np.zeros(costs.shape, dtype=bool)
        beside = int(np.ceil(BESIDE_M / (self._block * self._free_space.config.cell_m) - 1e-9))
        for r, c in search.traceback(tuple(ends[best])):
            corridor[max(r - beside, 0) : r + beside + 1, max(c - beside, 0) : c + beside + 1] = True
        return corridor

    def _cheapest(self, goals: Int[np.ndarray, "g 2"], corridor: Bool[np.ndarray, "p q"]) -> Path | None:
        """Return the cheapest path over the blocks of a corridor to the cheapest of some cells."""
        blocks = np.argwhere(corridor)
        first, end = blocks.min(axis=0), blocks.max(axis=0) + 1
        corner, past = self._block * first, self._block * end
        box = (slice(corner[0], past[0]), slice(corner[1], past[1]))
        metre = self._metre(box)
        metre[~cells_of(corridor[first[0] : end[0], first[1] : end[1]], metre.shape, self._block)] = -1.0
        goals, start = goals - corner, self._start - corner
        goals = goals[np.all((goals >= 0) & (goals < metre.shape), axis=1)]
        goals = goals[metre[tuple(goals.T)] > 0]
        if not len(goals):
            return None
        if self._config.robot.outline_m is not None:
            found = self._by_headings(corner, metre, start, goals)
            if found is None:
                return None
            way, _, costs = found
        else:
            search = MCP_Geometric(metre)
            costs = search.find_costs([tuple(goal) for goal in goals.tolist()])[0][..., None]
            if not np.isfinite(costs[tuple(start)]):
                return None
            way = np.array(search.traceback(tuple(start.tolist())), dtype=np.int64)[::-1]
        cell_m = self._free_space.config.cell_m
        cost = cell_m * float(costs[tuple(start)].min())
        corner_world = self._free_space.origin_world + cell_m * (corner + self._corner)[::-1]
        return Path(
            self._free_space.points(way + corner + self._corner),
            cost,
            Field(outwards(cell_m * costs, OUTWARDS_CELLS, OUTWARDS_COST * cell_m), corner_world, cell_m),
        )

    def _by_headings(
        self,
        corner: Int[np.ndarray, "2"],
        metre: Float[np.ndarray, "h w"],
        start: Int[np.ndarray, "2"],
        goals: Int[np.ndarray, "g 2"],
    ) -> tuple[Int[np.ndarray, "n 2"], Float[np.ndarray, " n"], Float[np.ndarray, "h w k"]] | None:
        """Return the way of a body with an outline over a part of the window that begins at a corner."""
        config, first = self._config, corner + self._corner
        part = tuple(slice(c, c + n) for c, n in zip(corner.tolist(), metre.shape, strict=True))
        ground = Ground(self._free_space.occupied, first, metre, self._escape[part], self._free_space.config.cell_m)
        room = Room(config.robot, config.squeeze_beyond_m, config.margin_m, config.squeeze_cost)
        return cheapest(ground, room, start, self._heading_rad, goals)

    def _metre(self, box: tuple[slice, slice]) -> Float[np.ndarray, "h w"]:
        """Return what a metre costs in each cell of a part of the window, -1 where no way leads."""
        metre = np.where(self._passable[box], metre_costs(self._clearance[box], self._roomy[box], self._config), -1.0)
        blind = cells_of(self._blind_blocks, self._passable.shape, self._block)[box]
        metre[blind & (metre > 0.0)] += self._config.blind_cost
        metre[self._escape[box]] = ESCAPE_COST
        return metre

    @cached_property
    def _is_connected(self) -> Bool[np.ndarray, "h w"]:
        """Which cells hang together with the start."""
        labels, _ = label(self._passable, structure=np.ones((3, 3)))
        return np.asarray(labels == labels[tuple(self._start)])

    @cached_property
    def _roomy_blocks(self) -> Bool[np.ndarray, "p q"]:
        return blocks_with_any(self._roomy, self._block)

    @cached_property
    def _blind_blocks(self) -> Bool[np.ndarray, "p q"]:
        """Which blocks lie too far from any wall to see it well."""
        return blind_blocks(self._free_space, self._box, self._config)

    @cached_property
    def _passable_blocks(self) -> Bool[np.ndarray, "p q"]:
        return blocks_with_any(self._passable, self._block)

    def within(self, cells: Bool[np.ndarray, "h w"]) -> "Planner":
        """Return a planner that keeps to some cells of the window, as it is now, and to what is around the robot."""
        kept = copy(self)
        for name in ("_is_connected", "_roomy_blocks", "_passable_blocks"):
            kept.__dict__.pop(name, None)
        start = np.zeros_like(self._escape)
        start[tuple(self._start)] = True
        cells = cells | self._escape | start
        kept._passable, kept._roomy = self._passable & cells, self._roomy & cells
        return kept

    @property
    def nowhere(self) -> Bool[np.ndarray, "h w"]:
        """No cell of the window."""
        return np.zeros_like(self._passable)

    def rows_and_columns(self, places_world: Float[np.ndarray, "n 2"]) -> Int[np.ndarray, "n 2"]:
        """Return the cells of the window (row, column) in which places lie; those outside of it have others."""
        return self._free_space.cells(places_world) - self._corner

    def passable_box(
        self, low_world: Float[np.ndarray, "2"], high_world: Float[np.ndarray, "2"]
    ) -> tuple[Int[np.ndarray, "2"], Bool[np.ndarray, "h w"]]:
        """Return the first cell of the part of the window between two corners, and where in it the body fits."""
        first, end = np.clip(self.rows_and_columns(np.stack([low_world, high_world])), 0, self._passable.shape)
        return first, self._passable[first[0] : end[0] + 1, first[1] : end[1] + 1]

    def centres(self, first: Int[np.ndarray, "2"], shape: tuple[int, ...]) -> Float[np.ndarray, "h w 2"]:
        """Return the centres of the cells of a part of the window, m."""
        return self._free_space.points(np.moveaxis(np.indices(shape), 0, -1) + first + self._corner)

    def passable_lines(
        self, starts_world: Float[np.ndarray, "n 2"], ends_world: Float[np.ndarray, "n 2"]
    ) -> Bool[np.ndarray, " n"]:
        """Return which straight ways lead over cells in which the body fits only."""
        length = float(np.hypot(*(ends_world - starts_world).T).max(initial=0.0))
        share = np.linspace(0.0, 1.0, int(np.ceil(length / (0.7 * self._free_space.config.cell_m))) + 2)[:, None, None]
        cells = self.rows_and_columns((starts_world + share * (ends_world - starts_world)).reshape(-1, 2))
        inside = np.all((cells >= 0) & (cells < self._passable.shape), axis=-1)
        fits = np.zeros(len(cells), dtype=bool)
        fits[inside] = self._passable[tuple(cells[inside].T)]
        return np.asarray(fits.reshape(len(share), -1).all(axis=0))

    def passable_points(self, cells: Int[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
        """Return the centres of those cells (row, column of the whole grid) where the robot's centre may stay, m."""
        local = cells - self._corner
        local = local[np.all((local >= 0) & (local < self._roomy.shape), axis=1)]
        return self._free_space.points(local[self._roomy[tuple(local.T)]] + self._corner)

    def _open_start(self, is_free: Bool[np.ndarray, "h w"]) -> None:
        """Make the free cells around the robot passable at a price, where they bring it no nearer to a wall."""
        reach = int(np.ceil(self._config.escape_m / self._free_space.config.cell_m))
        r, c = self._start
        box = (slice(max(r - reach, 0), r + reach + 1), slice(max(c - reach, 0), c + reach + 1))
        rows, columns = self._roomy[box].shape
        row, column = np.ogrid[box[0].start : box[0].start + rows, box[1].start : box[1].start + columns]
        near = np.hypot(row - r, column - c) <= reach
        self._escape[box] = near & ~self._passable[box] & is_free[box] & (self._clearance[box] >= self._clearance[r, c])
        self._escape[r, c] = False
        for cells in (self._passable, self._roomy):
            cells[box] |= self._escape[box]
            cells[r, c] = True
