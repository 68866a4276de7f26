"""Bends that the map knows, where a scan shows one straight piece.

Near a wall that turns by a degree or two, one line fits dozens of beams of both its parts: a second line saves less
than chance does, and yet the one line is wrong by many of the sigmas that so many beams state, the same way in scan
after scan. The map, which has seen each part alone, knows where to cut.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from .duplicates import same_line
from .geometry.lines import directions, normals
from .geometry.poses import to_robot, wrap
from .segments import Segments
from .stochastic_map import StochasticMap


@dataclass(frozen=True)
class BendsConfig:
    """Where two walls make a bend, and which segments pass over it."""

    reach_m: float = 0.1
    """Largest gap between the end of one wall and the beginning of the next. They may overlap: a line over both was
    given to one of them, which then reaches past the bend."""
    largest_rad: float = float(np.deg2rad(10.0))
    """A sharper bend is seen in every scan."""
    beside_m: float = 0.08
    """Distance across a segment within which a bend lies on it."""
    known: float = 0.9999
    """Probability level at which the two walls are not one line: in a straight building two pieces of one wall may
    stand in the map for a while."""
    past_m: float = 0.05
    """A segment goes on at least so far on both sides of the bend: ends are known no better."""


def bends_within(
    segments: Segments, walls: StochasticMap, config: BendsConfig = BendsConfig()
) -> Float[np.ndarray, " b"]:
    """Return the bearings, rad, of the map's bends that lie on a segment, at the pose of the map's belief."""
    if not len(segments):
        return np.zeros(0)
    points, alpha, pairs = _bends(walls, np.linalg.norm(segments.ends, axis=-1).max(), config)
    offset = points[:, None] - segments.ends[None, :, 0]
    along = np.vecdot(offset, directions(segments.lines[:, 0]))
    across = np.vecdot(offset, normals(segments.lines[:, 0]))
    length = segments.lengths_m
    on = (along > config.past_m) & (along < length - config.past_m) & (np.abs(across) < config.beside_m)
    on &= np.abs(wrap(alpha[:, None] - segments.lines[:, 0])) < config.largest_rad
    passed = on.any(axis=1)
    found = points[passed][_are_known(walls, pairs[passed], config)]
    return np.arctan2(found[:, 1], found[:, 0])


def _are_known(walls: StochasticMap, pairs: Int[np.ndarray, "b 2"], config: BendsConfig) -> Bool[np.ndarray, " b"]:
    """Return which pairs of walls are surely not one straight wall."""
    if not len(pairs):
        return np.zeros(0, dtype=bool)
    ids = np.unique(pairs)
    joint = walls.belief.joint(ids)
    return np.array([not same_line(joint.take(rows), config.known) for rows in np.searchsorted(ids, pairs)])


def _bends(
    walls: StochasticMap, range_m: float, config: BendsConfig
) -> tuple[Float[np.ndarray, "b 2"], Float[np.ndarray, " b"], Int[np.ndarray, "b 2"]]:
    """Return where bends may lie, m, the normals rad of the walls before them, robot frame, and both walls' ids.

    Walls that begin beyond `range_m` have none that a scan of that range shows.
    """
    pose, rows = walls.belief.pose_world, np.flatnonzero((walls.distances_m < range_m) & ~walls.tentative)
    alpha, ends = wrap(walls.belief.means[rows, 0] - pose[2]), to_robot(walls.ends_world[rows], pose)
    turn = wrap(alpha - alpha[:, None])
    # Every other wall's ends as seen from the head of each: along it, and across.
    offset = ends[None] - ends[:, None, 1:]
    along = np.vecdot(offset, directions(alpha)[:, None, None])
    across = np.vecdot(offset, normals(alpha)[:, None, None])[..., 0]
    gap, runs_on = along[..., 0], along[..., 1] > 0.0
    length = np.linalg.norm(ends[:, 1] - ends[:, 0], axis=-1)
    is_bend = (gap < config.reach_m) & (gap > -length[:, None]) & runs_on
    is_bend &= (np.abs(across) < config.beside_m) & (np.abs(turn) < config.largest_rad)
    before, after = np.nonzero(is_bend)
    gap, across, turn = gap[is_bend], across[is_bend], turn[is_bend]
    # Where the lines cross, if that is where both walls end or overlap; else the middle.
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = gap + across / np.tan(turn)
    low, high = np.minimum(gap, 0.0) - config.reach_m, np.maximum(gap, 0.0) + config.reach_m
    at = np.where((crossing > low) & (crossing < high), crossing, 0.5 * gap)
    pairs = walls.ids[rows][np.stack([before, after], axis=-1)]
    return ends[before, 1] + at[:, None] * directions(alpha[before]), alpha[before], pairs
