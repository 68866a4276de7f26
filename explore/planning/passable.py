"""Where on the floor that was seen free the robot fits, and what a metre of way costs there.

A body with an outline fits here where it would driving straight on; whether it can turn there, `headings` says.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float
from scipy.ndimage import distance_transform_edt

from chainslam.slam.geometry.quantities import Distance, Size, Weight
from chainslam.slam.robot import RobotSpec, of_robot

from ..floor.free_space import FreeSpace
from .grid_kernels import block_cells, blocks_with_any

COAST_SHARE = 0.75
"""Of the scanner's range: farther from walls than this it sees too few beams of them."""


@dataclass(frozen=True)
class PathConfig:
    """How close to walls a path may pass, and what that costs."""

    robot: RobotSpec = of_robot()
    margin_m: Distance = 0.025
    """Smallest clearance beside the body on a regular path, between cell centres."""
    squeeze_beyond_m: Distance = 0.0
    """Smallest clearance beside the body in narrow gaps, which are used only where no regular path exists."""
    squeeze_cost: Weight = 20.0
    """Additional cost of a metre with less clearance than `margin_m`; a metre on open floor costs 1."""
    standoff_beyond_m: Distance = 0.15
    """Clearance beyond the body's radius from which on a path costs nothing extra."""
    narrow_cost: Weight = 4.0
    """Additional cost of a metre at the smallest regular clearance; it falls to 0 at that of `standoff_beyond_m`."""
    coast_m: Size = 3.0
    """Distance from the nearest wall beyond which localisation counts as poor, at most three quarters of the scanner's
    range."""
    blind_cost: Weight = 4.0
    """Additional cost of a metre where localisation counts as poor."""
    escape_beyond_m: Distance = 0.1
    """Free cells this close to the body count as passable at any clearance, so that the robot can leave a wall."""

    def coast_of(self, range_m: float) -> float:
        """Return how far from walls a scanner of this range shows enough of them."""
        return min(self.coast_m, COAST_SHARE * range_m)

    @property
    def squeeze_m(self) -> float:
        """Least clearance between cell centres."""
        return self.robot.beside(self.squeeze_beyond_m)

    @property
    def standoff_m(self) -> float:
        """Distance of the middle of the body from walls that costs nothing."""
        return self.robot.beyond(self.standoff_beyond_m)

    @property
    def escape_m(self) -> float:
        """So far around the middle of the body it may get away."""
        return self.robot.beyond(self.escape_beyond_m)


def passable(
    free_space: FreeSpace, box: tuple[slice, slice], config: PathConfig
) -> tuple[Bool[np.ndarray, "h w"], Bool[np.ndarray, "h w"]]:
    """Return in which cells of a part of the grid the body fits, and in which it has room enough."""
    is_free, clearance = free_space.is_free(box), free_space.clearance()[box]
    roomy_cells = roomy(is_free, clearance, config)
    return roomy_cells | (is_free & (clearance > config.squeeze_m - 1e-4)), roomy_cells


def blind_blocks(free_space: FreeSpace, box: tuple[slice, slice], config: PathConfig) -> Bool[np.ndarray, "p q"]:
    """Return which blocks of a part of the grid lie farther than `coast_m` from all that was hit, there or beside."""
    block = block_cells(config.robot.half_width_m, free_space.config.cell_m)
    side_m = block * free_space.config.cell_m
    coast_m = config.coast_of(free_space.range_m)
    beside = int(np.ceil(coast_m / side_m))
    (r0, r1, _), (c0, c1, _) = (part.indices(size) for part, size in zip(box, free_space.shape, strict=True))
    above, left = min(beside, r0 // block), min(beside, c0 // block)
    rows = slice(r0 - block * above, r1 + block * beside)
    columns = slice(c0 - block * left, c1 + block * beside)
    hit = blocks_with_any(free_space.evidence[rows, columns] > 0, block)
    shape = -(-(r1 - r0) // block), -(-(c1 - c0) // block)
    if not hit.any():
        return np.ones(shape, dtype=bool)
    distance = distance_transform_edt(~hit, sampling=side_m)
    return np.asarray(distance[above : above + shape[0], left : left + shape[1]] > coast_m)


def roomy(
    is_free: Bool[np.ndarray, "*n"], clearance: Float[np.ndarray, "*n"], config: PathConfig
) -> Bool[np.ndarray, "*n"]:
    """Return in which cells the body has room enough, by whether they were seen free and their clearance, m."""
    return is_free & (clearance >= config.robot.half_width_m + config.margin_m)


def metre_costs(
    clearance: Float[np.ndarray, "h w"], is_roomy: Bool[np.ndarray, "h w"], config: PathConfig
) -> Float[np.ndarray, "h w"]:
    """Return what a metre costs in each cell, if the body fits there."""
    least = config.robot.half_width_m + config.margin_m
    tight = np.maximum((config.standoff_m - clearance) / (config.standoff_m - least), 0.0)
    return 1.0 + config.narrow_cost * tight**2 + np.where(is_roomy, 0.0, config.squeeze_cost)
