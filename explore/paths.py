"""Collision-free paths for the robot's disc over floor that was seen free."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from skimage.graph import MCP_Geometric

from .free_space import FreeSpace


@dataclass(frozen=True)
class PathConfig:
    """How near to walls a path may lead, and what it pays for it."""

    radius_m: float = 0.2
    """The robot's disc."""
    margin_m: float = 0.025
    """Least distance m kept beyond the radius, between cell centres."""
    squeeze_m: float = 0.2
    """Through gaps narrower than that, down to this clearance between cell centres, the robot squeezes where no other
    way leads: a door 0.05 m wider than the body shows no more on the grid. The scan tells whether it fits."""
    squeeze_cost: float = 20.0
    """What a metre of squeezing costs on top."""
    tight_m: float = 0.3
    """Around a place where the body did not fit it is not tried again."""
    standoff_m: float = 0.35
    """Distance from walls that costs nothing; it yields in narrow passages, the margin does not."""
    narrow_cost: float = 4.0
    """A metre at the least clearance costs this much more than one at the stand-off."""
    escape_m: float = 0.3
    """Around the robot itself free cells count as passable however near a wall is: it may have to get away."""


@dataclass(frozen=True)
class Path:
    """A way to one of the places asked for."""

    points_world: Float[np.ndarray, "n 2"]
    """Cell centres from the robot to the goal, m."""
    cost: float
    """Length in metres, with what narrow places cost on top."""
    reached: int
    """Which of the places asked for was the cheapest."""


class Planner:
    """Cheapest paths from one place over a free space as it is now, within a window of it."""

    def __init__(
        self,
        free_space: FreeSpace,
        start_world: Float[np.ndarray, "2"],
        config: PathConfig,
        window_m: float | None = None,
    ) -> None:
        """Look at the floor within `window_m` of the start in x and y, or at all of it."""
        self._free_space, self._config = free_space, config
        start = free_space.cells(start_world[None])[0]
        reach = max(free_space.shape) if window_m is None else int(np.ceil(window_m / free_space.config.cell_m))
        self._corner = np.maximum(start - reach, 0)
        box = (slice(self._corner[0], start[0] + reach + 1), slice(self._corner[1], start[1] + reach + 1))
        clearance = free_space.clearance()[box]
        is_free = free_space.is_free(box)
        self._costs, self._roomy = costs(is_free, clearance, free_space.may_fit(box, config.tight_m), config)
        self._start = start - self._corner
        self._open_start(is_free, clearance)

    def to(self, places_world: Float[np.ndarray, "n 2"]) -> Path | None:
        """Return the cheapest path to the cheapest of the places, or None if none can be reached."""
        cells = self._free_space.cells(places_world) - self._corner
        usable = np.flatnonzero(np.all((cells >= 0) & (cells < self._costs.shape), axis=1))
        usable = usable[self._costs[tuple(cells[usable].T)] > 0]
        if not len(usable):
            return None
        search = MCP_Geometric(self._costs)
        ends = [tuple(cell) for cell in cells[usable].tolist()]
        costs, _ = search.find_costs([tuple(self._start.tolist())], ends, find_all_ends=False)
        at_ends = costs[tuple(cells[usable].T)]
        best = int(np.argmin(at_ends))
        if not np.isfinite(at_ends[best]):
            return None
        way = np.array(search.traceback(ends[best]), dtype=np.int64)
        cost = float(at_ends[best]) * self._free_space.config.cell_m
        return Path(self._free_space.points(way + self._corner), cost, int(usable[best]))

    def passable_points(self, cells: Int[np.ndarray, "n 2"]) -> Float[np.ndarray, "m 2"]:
        """Return the centres of those cells (row, column of the whole grid) where the robot's centre may stay, m."""
        local = cells - self._corner
        local = local[np.all((local >= 0) & (local < self._costs.shape), axis=1)]
        return self._free_space.points(local[self._roomy[tuple(local.T)]] + self._corner)

    def has_room(self, points_world: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Return at which places, cells of the window, the body has room enough and need not squeeze."""
        return self._roomy[tuple((self._free_space.cells(points_world) - self._corner).T)]

    def clear_ahead(self, start_world: Float[np.ndarray, "2"], end_world: Float[np.ndarray, "2"]) -> bool:
        """Return whether the straight way between two places leads over cells with room enough only."""
        length = float(np.hypot(*(end_world - start_world)))
        share = np.linspace(0.0, 1.0, max(int(np.ceil(length / (0.5 * self._free_space.config.cell_m))), 1) + 1)
        cells = self._free_space.cells(start_world + share[:, None] * (end_world - start_world)) - self._corner
        on_grid = np.all((cells >= 0) & (cells < self._costs.shape), axis=1)
        return bool(np.all(on_grid) and np.all(self._roomy[tuple(cells.T)]))

    def _open_start(self, is_free: Bool[np.ndarray, "h w"], clearance: Float[np.ndarray, "h w"]) -> None:
        """Make the free cells around the robot passable at a price, where they bring it no nearer to a wall."""
        reach = int(np.ceil(self._config.escape_m / self._free_space.config.cell_m))
        r, c = self._start
        box = (slice(max(r - reach, 0), r + reach + 1), slice(max(c - reach, 0), c + reach + 1))
        row, column = np.ogrid[box]
        near = np.hypot(row - r, column - c)[: self._costs[box].shape[0], : self._costs[box].shape[1]] <= reach
        escape = near & (self._costs[box] < 0) & is_free[box] & (clearance[box] >= clearance[r, c])
        self._costs[box] = np.where(escape, 30.0, self._costs[box])
        self._roomy[box] |= escape
        self._costs[r, c] = max(self._costs[r, c], 1.0)
        self._roomy[r, c] = True


def costs(
    is_free: Bool[np.ndarray, "h w"],
    clearance: Float[np.ndarray, "h w"],
    may_fit: Bool[np.ndarray, "h w"],
    config: PathConfig,
) -> tuple[Float[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Return what a metre costs in each cell, -1 where the body does not fit, and which cells have room enough."""
    least = config.radius_m + config.margin_m
    roomy = is_free & (clearance >= least)
    squeezed = is_free & ~roomy & may_fit & (clearance > config.squeeze_m - 1e-4)
    tight = np.maximum((config.standoff_m - clearance) / (config.standoff_m - least), 0.0)
    metre = 1.0 + config.narrow_cost * tight**2 + np.where(squeezed, config.squeeze_cost, 0.0)
    return np.where(roomy | squeezed, metre, -1.0), roomy


def sees(
    free_space: FreeSpace, places_world: Float[np.ndarray, "n 2"], target_world: Float[np.ndarray, "2"], short_m: float
) -> Bool[np.ndarray, " n"]:
    """Return from which places no occupied cell stands between there and `short_m` before the target."""
    way = target_world - places_world
    length = np.hypot(way[:, 0], way[:, 1])
    steps = int(np.ceil(length.max(initial=0.0) / free_space.config.cell_m)) + 1
    share = np.linspace(0.0, 1.0, steps + 1) * np.clip(1.0 - short_m / np.maximum(length, 1e-9), 0.0, 1.0)[:, None]
    cells = free_space.cells(places_world[:, None] + share[..., None] * way[:, None])
    inside = free_space.inside(cells)
    blocked = np.zeros(inside.shape, dtype=bool)
    blocked[inside] = free_space.evidence[tuple(cells[inside].T)] > 0
    return ~np.any(blocked | ~inside, axis=1)


def cells_within(free_space: FreeSpace, centre_world: Float[np.ndarray, "2"], reach_m: float) -> Int[np.ndarray, "n 2"]:
    """Return the cells of the grid whose centres lie within reach of a place."""
    reach = int(np.ceil(reach_m / free_space.config.cell_m))
    offsets = np.stack(np.meshgrid(*[np.arange(-reach, reach + 1)] * 2, indexing="ij"), axis=-1).reshape(-1, 2)
    cells = free_space.cells(centre_world[None])[0] + offsets
    cells = cells[free_space.inside(cells)]
    return cells[np.hypot(*(free_space.points(cells) - centre_world).T) <= reach_m]
