"""Where what a robot saw lies on surfaces that are known: all places and turns of a window are tried.

Second looks lay a submap on an older one so; a robot that is lost lays its scan on the whole map. A place is believed
where no other one is nearly as good: buildings repeat themselves.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ..extraction.segments import Segments
from ..geometry.poses import rotation, wrap
from ..geometry.quantities import Angle, Distance, Share, Size, Turn
from ..map.stochastic_map import StochasticMap
from ..odometry.config import ScanMatchingConfig
from ..odometry.field_kernels import field_of
from ..odometry.point_kernels import joined
from ..odometry.search_kernels import refine
from .kernels.correlation_kernels import best_in_blocks, largest_ahead

BLOCK = 8
"""Cells on each side of a block of places that are ruled out together."""
FINE = 0.5
"""The best place is looked up anew on cells and with a kernel of this share."""


@dataclass(frozen=True)
class PlaceSearchConfig:
    """How finely a pose is searched, and when the best one is accepted."""

    cell_m: Size = 0.1
    """Cell size of the search, and standard deviation of the likelihood field around each known point."""
    step_rad: Turn = ScanMatchingConfig.step_rad
    """Step between the headings that are tried."""
    least: Share = ScanMatchingConfig.slip_score
    """Smallest mean likelihood of an accepted pose."""
    rival: Share = 0.9
    """Largest likelihood of any other place, relative to the accepted one."""
    apart_m: Distance = 0.5
    """Poses farther apart than this are different places."""
    apart_rad: Angle = float(np.deg2rad(10.0))
    """Poses whose headings differ by more than this are different places."""

    @property
    def cov(self) -> Float[np.ndarray, "3 3"]:
        """The covariance of a place that was found: a cell and a step of the search."""
        return np.diag([self.cell_m, self.cell_m, self.step_rad]) ** 2


@dataclass(frozen=True)
class Window:
    """The poses that are tried: about a guess, world frame, by so much to each side."""

    guess: Float[np.ndarray, "3"]
    half_m: float
    half_rad: float


@dataclass(frozen=True)
class Place:
    """Where points fit known surfaces."""

    pose: Float[np.ndarray, "3"]
    score: float
    """Mean likelihood of the points; 1 is a perfect fit."""
    rival: float
    """That of the best place apart from it, 0 where none comes near it."""
    rival_pose: Float[np.ndarray, "3"] | None = None
    """That place."""

    def is_right(self, config: PlaceSearchConfig) -> bool:
        """Return whether it is a fit, and no other place nearly as good."""
        return self.score >= config.least and self.rival <= config.rival * self.score


def apart(
    poses: Float[np.ndarray, "m 3"], of: Float[np.ndarray, "3"], config: PlaceSearchConfig
) -> Bool[np.ndarray, " m"]:
    """Return which poses are other places than one."""
    off = poses - of
    return (np.hypot(*off[:, :2].T) > config.apart_m) | (np.abs(wrap(off[:, 2])) > config.apart_rad)


def place_on(
    surface_world: Float[np.ndarray, "m 2"],
    points: Float[np.ndarray, "n 2"],
    window: Window,
    config: PlaceSearchConfig = PlaceSearchConfig(),
) -> Place | None:
    """Return the place of a window that lays points, robot frame, best on known surfaces; None where none does."""
    c = config
    poses, scores = _fitting(surface_world, points, window, c)
    if not len(poses):
        return None
    best = int(np.argmax(scores))
    others = np.flatnonzero(apart(poses, poses[best], c))
    second = int(others[np.argmax(scores[others])]) if len(others) else None
    rival, rival_pose = (0.0, None) if second is None else (float(scores[second]), poses[second])
    far = float(np.hypot(*points.T).max())
    fine = field_of(surface_world, poses[best, :2], far, FINE * c.cell_m, FINE * c.cell_m, 4)
    pose, _ = refine(fine, points, poses[best], 0.5 * c.step_rad, 0.1 * c.cell_m)
    return Place(pose, float(scores[best]), rival, rival_pose)


def places_anywhere(
    surface_world: Float[np.ndarray, "m 2"], points: Float[np.ndarray, "n 2"], config: PlaceSearchConfig, most: int
) -> Float[np.ndarray, "p 3"]:
    """Return up to `most` places apart from each other that fit about as well as the best one, best first.

    They are as fine as the cells of the search.
    """
    poses, scores = _fitting(surface_world, points, _everywhere(surface_world, points), config)
    found: list[np.ndarray] = []
    for k in np.argsort(-scores):
        if len(found) == most or scores[k] < config.least or scores[k] < config.rival * scores.max():
            break
        if all(apart(poses[k][None], each, config)[0] for each in found):
            found.append(poses[k])
    return np.array(found).reshape(-1, 3)


def _fitting(
    surface_world: Float[np.ndarray, "m 2"], points: Float[np.ndarray, "n 2"], window: Window, config: PlaceSearchConfig
) -> tuple[Float[np.ndarray, "p 3"], Float[np.ndarray, " p"]]:
    """Return the poses of a window that fit about as well as the best one, and their scores."""
    c = config
    far = float(np.hypot(*points.T).max())
    field = field_of(surface_world, window.guess[:2], far + window.half_m, c.cell_m, c.cell_m, 2)
    turns = int(np.ceil(window.half_rad / c.step_rad))
    angles = window.guess[2] + np.arange(-turns, turns + 1) * c.step_rad
    turned = np.array([points @ rotation(angle).T for angle in angles]) + window.guess[:2]
    at = np.rint((turned - field.corner) / c.cell_m).astype(np.int32)
    values = field.values.astype(np.float32)
    found = best_in_blocks(
        values, largest_ahead(values, BLOCK), np.ascontiguousarray(at[..., 1]), np.ascontiguousarray(at[..., 0]),
        int(np.ceil(window.half_m / c.cell_m)), BLOCK, c.rival * c.least, c.rival,
    )  # fmt: skip
    moved = window.guess[:2] + c.cell_m * found[:, :0:-1][:, :2]
    return np.column_stack([moved, angles[found[:, 1].astype(np.int64)]]), found[:, 0]


def place_of(
    segments: Segments,
    walls: StochasticMap,
    config: PlaceSearchConfig,
    likely_world: Float[np.ndarray, "3"] | None = None,
) -> Float[np.ndarray, "3"] | None:
    """Return the pose, world frame, from which the map explains a scan; None where none does, or several do.

    A `likely_world` pose is taken where no other explains much more.
    """
    points = along(segments.take(np.flatnonzero(~segments.is_tentative)).ends, config.cell_m)
    surface_world = along(walls.ends_world, 0.5 * config.cell_m)
    if not len(points) or not len(surface_world):
        return None
    best = place_anywhere(surface_world, points, config)
    if likely_world is not None:
        likely = place_on(surface_world, points, Window(likely_world, 0.0, 0.0), config)
        if likely is not None and (best is None or likely.score >= config.rival * best.score):
            return likely_world
    return best.pose if best is not None and best.is_right(config) else None


def place_anywhere(
    surface_world: Float[np.ndarray, "m 2"], points: Float[np.ndarray, "n 2"], config: PlaceSearchConfig
) -> Place | None:
    """Return the place that lays points, robot frame, best on known surfaces, whichever way the robot is turned."""
    return place_on(surface_world, points, _everywhere(surface_world, points), config)


def _everywhere(surface_world: Float[np.ndarray, "m 2"], points: Float[np.ndarray, "n 2"]) -> Window:
    """Return the window of all poses from which any of the points lies near a surface."""
    low, high = surface_world.min(axis=0), surface_world.max(axis=0)
    half_m = 0.5 * float((high - low).max()) + float(np.hypot(*points.T).max())
    return Window(np.array([*(0.5 * (low + high)), 0.0]), half_m, np.pi)


def along(ends: Float[np.ndarray, "n 2 2"], every_m: float) -> Float[np.ndarray, "m 2"]:
    """Return the points of line segments, no farther apart than that."""
    return np.concatenate([np.zeros((0, 2)), *(joined(pair, every_m, np.inf) for pair in ends)])
