"""Bends that the map knows, where a scan shows one straight piece.

Near a wall that turns by a degree or two, one line fits dozens of beams of both its parts: a second line saves less
than chance does, and yet the one line is wrong by many of the sigmas that so many beams state, the same way in scan
after scan. The map, which has seen each part alone, knows where to cut.
"""

from collections.abc import Collection
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
    cut_reach_m: float = 0.5
    """The same gap between two walls that are known to be pieces of one bent wall: far from the robot no beam may have
    met either of them near the bend."""
    past_m: float = 0.05
    """A segment goes on at least so far on both sides of the bend: ends are known no better."""


def bends_within(
    segments: Segments,
    walls: StochasticMap,
    config: BendsConfig = BendsConfig(),
    cut: Collection[tuple[int, int]] = (),
) -> Float[np.ndarray, " b"]:
    """Return the bearings, rad, of the map's bends that lie on a segment, at the pose of the map's belief.

    `cut` are pairs of ids, the lower first, of which it is known that they are two walls (`kinks`).
    """
    if not len(segments):
        return np.zeros(0)
    points, alpha, pairs, is_cut = _bends(walls, np.linalg.norm(segments.ends, axis=-1).max(), config, cut)
    offset = points[:, None] - segments.ends[None, :, 0]
    along = np.vecdot(offset, directions(segments.lines[:, 0]))
    across = np.vecdot(offset, normals(segments.lines[:, 0]))
    length = segments.lengths_m
    on = (along > config.past_m) & (along < length - config.past_m) & (np.abs(across) < config.beside_m)
    on &= np.abs(wrap(alpha[:, None] - segments.lines[:, 0])) < config.largest_rad
    passed = on.any(axis=1)
    passed[~is_cut & passed] = _are_known(walls, pairs[~is_cut & passed], config)
    found = points[passed]
    return np.arctan2(found[:, 1], found[:, 0])


def _are_known(walls: StochasticMap, pairs: Int[np.ndarray, "b 2"], config: BendsConfig) -> Bool[np.ndarray, " b"]:
    """Return which pairs of walls are surely not one straight wall."""
    if not len(pairs):
        return np.zeros(0, dtype=bool)
    ids = np.unique(pairs)
    joint = walls.belief.joint(ids)
    return np.array([not same_line(joint.take(rows), config.known) for rows in np.searchsorted(ids, pairs)])


def _bends(
    walls: StochasticMap, range_m: float, config: BendsConfig, cut: Collection[tuple[int, int]]
) -> tuple[Float[np.ndarray, "b 2"], Float[np.ndarray, " b"], Int[np.ndarray, "b 2"], Bool[np.ndarray, " b"]]:
    """Return where bends may lie, m, the normals rad of the walls before them, robot frame, and both walls' ids.

    And which of these pairs are known to be two walls.

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
    is_cut = _are_pairs(walls.ids[rows], cut)
    reach = np.where(is_cut, config.cut_reach_m, config.reach_m)
    is_bend = (gap < reach) & (gap > -length[:, None]) & runs_on
    is_bend &= (np.abs(across) < config.beside_m) & (np.abs(turn) < config.largest_rad)
    before, after = np.nonzero(is_bend)
    gap, across, turn = gap[is_bend], across[is_bend], turn[is_bend]
    # Where the lines cross, if that is where both walls end or overlap; else the middle.
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = gap + across / np.tan(turn)
    low, high = np.minimum(gap, 0.0) - config.reach_m, np.maximum(gap, 0.0) + config.reach_m
    at = np.where((crossing > low) & (crossing < high), crossing, 0.5 * gap)
    pairs = walls.ids[rows][np.stack([before, after], axis=-1)]
    return ends[before, 1] + at[:, None] * directions(alpha[before]), alpha[before], pairs, is_cut[is_bend]


def _are_pairs(ids: Int[np.ndarray, " n"], pairs: Collection[tuple[int, int]]) -> Bool[np.ndarray, "n n"]:
    """Return for each two of the ids, which ascend, whether they are one of the pairs, in either order."""
    are_pairs = np.zeros((len(ids), len(ids)), dtype=bool)
    wanted = np.array(list(pairs), dtype=np.int64).reshape(-1, 2)
    wanted = wanted[np.isin(wanted, ids).all(axis=1)]
    one, other = np.searchsorted(ids, wanted).T
    are_pairs[one, other] = are_pairs[other, one] = True
    return are_pairs
