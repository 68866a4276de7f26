"""Floor that was seen free but lies behind gaps through which the body does not fit."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.ndimage import distance_transform_edt, label
from skimage.graph import MCP_Geometric

from ..floor.free_space import FreeSpace
from ..planning.passable import PathConfig, passable

WHOLE = (slice(None), slice(None))
EIGHT = np.ones((3, 3))


@dataclass(frozen=True)
class NarrowGap:
    """The widest passage to a part of the floor that the robot cannot reach."""

    width_m: float
    """Between the nearest occupied cells on both sides, so good to a cell."""
    body_m: float
    """Width of the body."""
    position_world: Float[np.ndarray, "2"]
    """The narrowest place, m."""
    beyond_m2: float
    """Area of the floor seen free beyond it on which the body would fit."""

    @property
    def why(self) -> str:
        """Why the floor beyond is not reached, in words."""
        return f"a gap of about {self.width_m:.2f} m is too narrow for the body ({self.body_m:.2f} m)"


def narrow_gaps(
    free_space: FreeSpace, robot_world: Float[np.ndarray, "2"], config: PathConfig
) -> tuple[NarrowGap, ...]:
    """Return the widest passage to each part of the seen floor that is cut off from the robot, the largest part first.

    Gaps of two cells or less are left out, since the errors of a few beams open such in any wall.
    """
    is_free, clearance, cell_m = free_space.is_free(WHOLE), free_space.clearance(), free_space.config.cell_m
    fits, is_roomy = passable(free_space, WHOLE, config)
    parts, count = label(fits, structure=EIGHT)
    if not count:
        return ()
    start = np.argwhere(fits)
    start = start[np.argmin(np.hypot(*(free_space.points(start) - robot_world).T))]
    reachable = parts == parts[tuple(start)]
    cut_off = set(np.unique(parts[is_roomy & ~reachable]).tolist()) - {0}
    found = []
    for least_m in sorted({*clearance[is_free & (clearance > 1.01 * cell_m)].tolist()}, reverse=True):
        if not cut_off:
            break
        if least_m >= config.squeeze_m:
            continue
        wide = label(fits | (is_free & (clearance >= least_m)), structure=EIGHT)[0]
        connected = wide == wide[tuple(start)]
        for part in sorted(cut_off & set(np.unique(parts[connected]).tolist())):
            cut_off.discard(part)
            cells = _way(connected, reachable, np.argwhere(parts == part))
            narrowest = cells[np.argmin(clearance[tuple(cells.T)])]
            covered = distance_transform_edt(parts != part, sampling=cell_m) <= config.robot.half_width_m
            found.append(
                NarrowGap(
                    _width_m(free_space, free_space.points(narrowest)),
                    2.0 * config.robot.half_width_m,
                    free_space.points(narrowest),
                    float(np.count_nonzero(is_free & covered)) * cell_m**2,
                )
            )
    return tuple(sorted(found, key=lambda gap: -gap.beyond_m2))


def _width_m(free_space: FreeSpace, place_world: Float[np.ndarray, "2"]) -> float:
    """Return the distance between what is nearest to a place and what is nearest to it on the other side, m."""
    held = free_space.points(np.argwhere(free_space.occupied)) - place_world
    nearest = held[np.argmin(np.hypot(*held.T))]
    other = held[held @ nearest < 0.0]
    return float(np.hypot(*(other - nearest).T).min(initial=np.inf))


def _way(
    connected: Bool[np.ndarray, "h w"], reachable: Bool[np.ndarray, "h w"], goals: Int[np.ndarray, "g 2"]
) -> Int[np.ndarray, "n 2"]:
    """Return the cells of a shortest way from what is reachable to some cells, over connected ones."""
    search = MCP_Geometric(np.where(connected, 1.0, -1.0))
    costs, _ = search.find_costs(np.argwhere(reachable & connected).tolist(), goals.tolist(), find_all_ends=False)
    nearest = goals[np.argmin(costs[tuple(goals.T)])]
    return np.array(search.traceback(tuple(nearest.tolist())), dtype=np.int64)
