"""What a mission can vouch for at its end: the contours it closed, the ends it left and why, the floor it never saw."""

from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Bool, Float
from PIL import Image, ImageDraw
from shapely.geometry.polygon import orient

from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

from .floor.free_space import FreeSpace
from .goal import GivenUp
from .outcome import Outcome
from .planning.driving_field import DrivingField
from .planning.passable import PathConfig
from .step import Step
from .survey.frontiers import frontiers
from .survey.narrow_gaps import NarrowGap, narrow_gaps
from .survey.unmapped_obstacles import unmapped_obstacles

WALL_FRINGE_M = 0.1
"""Floor this near to a closed contour counts as seen: two cells, into which walls and their errors reach."""

LEAST_AREA_M2 = 1e-4
"""What surrounds less has no inside."""


@dataclass(frozen=True)
class ClosedContour:
    """A closed chain as an area."""

    chain: int
    """Index of the chain."""
    walls: tuple[int, ...]
    is_island: bool
    """Whether the robot drives around it; else it is a room, and the robot drives inside."""
    polygon: shapely.Polygon
    """Valid, without holes, counter-clockwise, world frame, m."""


@dataclass(frozen=True)
class LeftOpen:
    """An open end that is left."""

    wall: int
    side: int
    position_world: Float[np.ndarray, "2"]
    why: str


@dataclass(frozen=True)
class LeftFrontier:
    """A border between floor that can be driven to and floor that was never seen."""

    cells_world: Float[np.ndarray, "n 2"]
    """The cells on the near side, m."""
    length_m: float
    why: str


@dataclass(frozen=True)
class LeftObstacle:
    """Something that stopped beams and is no wall of the map."""

    cells_world: Float[np.ndarray, "n 2"]
    """The cells that were hit, m."""
    why: str


@dataclass(frozen=True)
class Certificate:
    """The end of a mission, with its reasons."""

    outcome: Outcome
    contours: tuple[ClosedContour, ...]
    open_ends: tuple[LeftOpen, ...]
    frontiers: tuple[LeftFrontier, ...] | None
    """None where nobody kept the free space (a recorded robot)."""
    obstacles: tuple[LeftObstacle, ...] | None
    """None as `frontiers`."""
    narrow_gaps: tuple[NarrowGap, ...] | None
    """Gaps too narrow for the body, behind which floor was seen; None as `frontiers`."""
    floor_m2: float
    """Area inside the closed rooms, without their islands; 0 where no room is closed."""
    unseen_m2: float | None
    """What of it no scan has seen, the fringe of the walls left out; None without a closed room, or as `frontiers`."""
    reachable_way: float | None
    """Share of the places where the robot believes to have been that it could drive to again; None as `frontiers`. Well
    below 1 it has locked itself in, or its map has come to contradict the way that it took."""


def certify(
    step: Step, outcome: Outcome, paths: PathConfig, sweep: bool, way_world: Float[np.ndarray, "s 2"]
) -> Certificate:
    """Return what the last step of a mission can vouch for; `sweep` says whether unseen floor was to be visited.

    `way_world` is where the robot believed to be at each step, m. It reads the free space as it is now, so ask before
    the mission goes on.
    """
    found = contours(step.map, step.chains)
    floor = floor_of(found)
    kept = bool(step.free_space.evidence.size)
    return Certificate(
        outcome,
        found,
        left_open(step, outcome),
        left_frontiers(step, paths, sweep) if kept else None,
        left_obstacles(step, sweep) if kept else None,
        narrow_gaps(step.free_space, step.pose_world[:2], paths) if kept else None,
        float(floor.area),
        unseen_area(step.free_space, floor.buffer(-WALL_FRINGE_M)) if kept and not floor.is_empty else None,
        reachable_way(step, paths, way_world) if kept else None,
    )


def contours(walls: StochasticMap, chains: tuple[Chain, ...]) -> tuple[ClosedContour, ...]:
    """Return the closed chains as areas; free side on the left, so a room is run through counter-clockwise."""
    found = []
    for index, chain in enumerate(chains):
        if not chain.is_closed:
            continue
        # A slab of two walls has no area between its two corners, only between its four ends.
        ends = np.concatenate(walls.ends_world[walls.belief.rows(chain.walls)])
        for ring in (chain.corners_world, ends):
            polygon = _valid(ring)
            if polygon is not None:
                found.append(ClosedContour(index, chain.walls, _turns_right(ring), polygon))
                break
    return tuple(found)


def _turns_right(ring: Float[np.ndarray, "n 2"]) -> bool:
    """Return whether a ring is run through clockwise, by the sign of the area that it surrounds."""
    after = np.roll(ring, -1, axis=0)
    return bool(np.sum(ring[:, 0] * after[:, 1] - ring[:, 1] * after[:, 0]) < 0.0)


def _valid(ring: Float[np.ndarray, "n 2"]) -> shapely.Polygon | None:
    """Return the (largest) area that a ring surrounds; None where it surrounds none."""
    if len(ring) < 3:
        return None
    parts = shapely.get_parts(shapely.get_parts(shapely.make_valid(shapely.Polygon(ring))))
    areas = [part for part in parts if isinstance(part, shapely.Polygon) and part.area > LEAST_AREA_M2]
    return orient(shapely.Polygon(max(areas, key=lambda part: part.area).exterior)) if areas else None


def floor_of(found: tuple[ClosedContour, ...]) -> shapely.Polygon | shapely.MultiPolygon:
    """Return the inside of the closed rooms without their islands."""
    rooms = shapely.union_all([contour.polygon for contour in found if not contour.is_island])
    islands = shapely.union_all([contour.polygon for contour in found if contour.is_island])
    floor = rooms.difference(islands)
    return shapely.MultiPolygon([p for p in shapely.get_parts(floor) if isinstance(p, shapely.Polygon)])


def left_open(step: Step, outcome: Outcome) -> tuple[LeftOpen, ...]:
    """Return the open ends of the last map, each with the reason why it is one."""
    reasons = {(end.wall, end.side): end.reason for end in step.decision.given_up.ends}
    otherwise = "not explored yet" if outcome.status != "complete" else "seen at the end"
    return tuple(
        LeftOpen(end.wall, end.side, end.position_world, reasons.get((end.wall, end.side), otherwise))
        for chain in step.chains
        for end in chain.open_ends
    )


def left_frontiers(step: Step, paths: PathConfig, sweep: bool) -> tuple[LeftFrontier, ...]:
    """Return the borders of unseen floor that the robot can drive to, each with the reason why it is left."""
    field = DrivingField(step.free_space, step.pose_world[:2], paths)
    borders = frontiers(step.free_space, field)
    cell = step.free_space.config.cell_m
    return tuple(
        LeftFrontier(
            border,
            len(border) * cell,
            _why_left(border, step.decision.given_up, "what lies behind was not all seen from there")
            if sweep
            else "unseen floor was not to be visited",
        )
        for border in borders
    )


def left_obstacles(step: Step, sweep: bool) -> tuple[LeftObstacle, ...]:
    """Return what stopped beams and is no wall of the map, each with the reason why it is left."""
    return tuple(
        LeftObstacle(
            thing,
            _why_left(thing, step.decision.given_up, "no scan from there shows a wall")
            if sweep
            else "what is no wall of the map was not to be looked at",
        )
        for thing in unmapped_obstacles(step.free_space, step.map)
    )


def reachable_way(step: Step, paths: PathConfig, way_world: Float[np.ndarray, "s 2"]) -> float:
    """Return the share of some places to which a way is known over the floor seen free."""
    metres = DrivingField(step.free_space, step.pose_world[:2], paths).metres(way_world)
    return float(np.isfinite(metres).mean())


def _why_left(points: Float[np.ndarray, "n 2"], given_up: GivenUp, in_vain: str) -> str:
    """Return what came of the visits of a border of unseen floor, or of a thing; `in_vain`, if all got there."""
    troubles = given_up.troubles_at(points.mean(axis=0))
    if not troubles:
        return "not visited yet"
    in_the_way = [trouble for trouble in troubles if trouble]
    if in_the_way:
        return f"not reached: {in_the_way[-1]}"
    return f"visited {len(troubles)} times, and {in_vain}"


def unseen_area(free_space: FreeSpace, floor: shapely.Polygon | shapely.MultiPolygon) -> float:
    """Return how much of a floor no scan has seen, m2, by cells."""
    image = Image.new("1", free_space.shape[::-1])
    brush = ImageDraw.Draw(image)
    parts = [part for part in shapely.get_parts(floor) if isinstance(part, shapely.Polygon) and not part.is_empty]
    for rings, inside in (([p.exterior for p in parts], 1), ([hole for p in parts for hole in p.interiors], 0)):
        for ring in rings:
            cells = _continuous_cells(free_space, shapely.get_coordinates(ring))
            brush.polygon([(float(x), float(y)) for y, x in cells], fill=inside)
    unknown: Bool[np.ndarray, "h w"] = free_space.evidence == 0
    return int(np.count_nonzero(unknown & np.asarray(image))) * free_space.config.cell_m**2


def _continuous_cells(free_space: FreeSpace, points_world: Float[np.ndarray, "n 2"]) -> Float[np.ndarray, "n 2"]:
    """Return points as fractions of (row, column), whole numbers at the centres of cells."""
    return ((points_world - free_space.origin_world) / free_space.config.cell_m - 0.5)[:, ::-1]
