"""Bends that the map knows, where a scan shows one straight piece.

Near a wall that turns by a degree or two, one line fits dozens of beams of both its parts: a second line saves less
than chance does, and yet the one line is wrong by many of the sigmas that so many beams state, the same way in scan
after scan. The map, which has seen each part alone, knows where to cut.
"""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.gates import gate_level
from ..extraction.segments import Segments
from ..geometry.lines import directions, normals
from ..geometry.poses import to_robot, to_world, wrap
from .merging import same_line
from .stochastic_map import StochasticMap

LEAST_RAD = float(np.deg2rad(0.2))
"""Smaller turns are no bends: over thousands of beams every real wall shows one, and walls that overlap may be one that
was entered twice."""


@dataclass(frozen=True)
class VerticesConfig:
    """Where two walls make a bend, and which segments pass over it."""

    reach_m: float = 0.1
    """Largest gap between the end of one wall and the beginning of the next. They may overlap: a line over both was
    given to one of them, which then reaches past the bend."""
    largest_rad: float = float(np.deg2rad(10.0))
    """A sharper bend is seen in every scan."""
    slight_rad: float = float(np.deg2rad(2.0))
    """Walls that overlap and turn more are not ended where their lines cross: which of them a beam met is plain, and
    one of them may be a line laid across a step."""
    beside_m: float = 0.08
    """Distance across a segment within which a bend lies on it."""
    cut_reach_m: float = 0.5
    """The same gap between two walls that are known to be pieces of one bent wall: far from the robot no beam may have
    met either of them near the bend."""
    past_shown_m: float = 0.15
    """A wall that reaches so far beyond a bend that a scan shows, on both sides, was laid across it: a beam of the
    other side may have been taken in, at 4 m one in 0.13 m."""
    sharpest_rad: float = float(np.deg2rad(30.0))
    """And the largest turn of such a bend: round an apse of eight sides two of them are one line to a few scans."""
    past_m: float = 0.05
    """Ends are known no better: a segment goes on at least so far on both sides of a bend, and walls that overlap by
    less do not."""


def vertices_within(
    segments: Segments,
    walls: StochasticMap,
    one_wall: float,
    config: VerticesConfig = VerticesConfig(),
    cut: Collection[tuple[int, int]] = (),
) -> Float[np.ndarray, " b"]:
    """Return the bearings, rad, of the map's bends that lie on a segment, at the pose of the map's belief.

    At the probability level `one_wall` the two sides are not one line: in a straight building two pieces of one wall
    may stand in the map for a while. `cut` are pairs of ids, the lower first, of which it is known that they are two
    walls (`change_points`).
    """
    if not len(segments):
        return np.zeros(0)
    bends = _bends(walls, np.linalg.norm(segments.ends, axis=-1).max(), config, cut)
    alpha_world = walls.belief.means[bends.rows[:, 0], 0]
    points, alpha = to_robot(bends.points_world, walls.belief.pose_world), alpha_world - walls.belief.pose_world[2]
    offset = points[:, None] - segments.ends[None, :, 0]
    along = np.vecdot(offset, directions(segments.lines[:, 0]))
    across = np.vecdot(offset, normals(segments.lines[:, 0]))
    length = segments.lengths_m
    on = (along > config.past_m) & (along < length - config.past_m) & (np.abs(across) < config.beside_m)
    on &= np.abs(wrap(alpha[:, None] - segments.lines[:, 0])) < config.largest_rad
    found = points[_are_known(bends, on.any(axis=1), walls, one_wall)]
    return np.arctan2(found[:, 1], found[:, 0])


def meetings(
    walls: StochasticMap,
    range_m: float,
    one_wall: float,
    config: VerticesConfig = VerticesConfig(),
    cut: Collection[tuple[int, int]] = (),
) -> tuple[Int[np.ndarray, "k 2"], Float[np.ndarray, "k 2"]]:
    """Return ids of walls that overlap, before and after a bend, and how far along each from its anchor they meet, m.

    Within `range_m` of the robot; `one_wall` and `cut` as above.
    """
    bends = _bends(walls, range_m, config, cut)
    slight = (bends.turn_rad > LEAST_RAD) & (bends.turn_rad < config.slight_rad)
    asked = bends.overlap & (bends.is_cut | (bends.cross & slight))
    known = _are_known(bends, asked, walls, one_wall)
    rows = bends.rows[known]
    from_anchor = bends.points_world[known][:, None] - walls.belief.anchors[rows]
    along = np.vecdot(from_anchor, directions(walls.belief.means[rows, 0]))
    # Where the lines cross a little outside the overlap, its end is near enough.
    short, far = walls.extents[rows[:, 1], 0] - along[:, 1], along[:, 0] - walls.extents[rows[:, 0], 1]
    return walls.ids[rows], along + (np.maximum(short, 0.0) - np.maximum(far, 0.0))[:, None]


def mistaken(
    segments: Segments, walls: StochasticMap, gate: float, config: VerticesConfig = VerticesConfig()
) -> Int[np.ndarray, " n"]:
    """Return the ids of walls laid across a bend that this scan shows, and few scans before it.

    Two neighbours in it turn, at the probability level `gate`: that they are two, the cut between them tells, too.

    From 4 m the sides of a bend of a few degrees are one line of eight beams; from a step nearer they are two, and the
    clearer of them passes every gate of that line and turns the robot by half the bend.
    """
    after = np.roll(np.arange(len(segments)), -1)
    turn = wrap(segments.lines[after, 0] - segments.lines[:, 0])
    variance = segments.cov[:, 0, 0] + segments.cov[after, 0, 0]
    between = segments.ends[after, 0] - segments.ends[:, 1]
    shown = ~segments.is_tentative & ~segments.is_tentative[after] & (np.abs(turn) < config.sharpest_rad)
    shown &= (turn**2 > gate_level(gate, 1) * variance) & (np.linalg.norm(between, axis=1) < config.cut_reach_m)
    before = np.flatnonzero(shown)
    pose = walls.belief.pose_world
    points = to_world(segments.ends[before, 1] + 0.5 * between[before], pose)
    alpha = segments.lines[before, 0] + pose[2] + 0.5 * turn[before]
    means = walls.belief.means[:, 0]
    offset = points[:, None, None] - walls.ends_world
    along, across = (np.vecdot(offset, axis[:, None]) for axis in (directions(means), normals(means)))
    laid = (along[..., 0] > config.past_shown_m) & (along[..., 1] < -config.past_shown_m)
    laid &= np.abs(across[..., 0]) < config.beside_m
    laid &= np.abs(wrap(means - alpha[:, None])) < config.largest_rad
    return walls.ids[laid.any(axis=0) & ~walls.established]


@dataclass(frozen=True)
class _Vertices:
    """Where walls may make a bend."""

    rows: Int[np.ndarray, "b 2"]
    """Of the walls before and after it."""
    points_world: Float[np.ndarray, "b 2"]
    """Where it lies, m: where the lines cross, if both walls end or overlap there; else amid the two ends."""
    turn_rad: Float[np.ndarray, " b"]
    """From one normal to the other, without its sign."""
    cross: Bool[np.ndarray, " b"]
    """Whether it lies where the lines cross."""
    overlap: Bool[np.ndarray, " b"]
    """Whether the walls overlap, by more than ends are known to."""
    is_cut: Bool[np.ndarray, " b"]
    """Whether it is known that they are two."""


def _are_known(
    bends: _Vertices, asked: Bool[np.ndarray, " b"], walls: StochasticMap, one_wall: float
) -> Bool[np.ndarray, " b"]:
    """Return which of the bends asked for lie between walls that are surely not one straight wall."""
    known = asked & bends.is_cut
    open_to_doubt = np.flatnonzero(asked & ~bends.is_cut)
    if len(open_to_doubt):
        used, places = np.unique(bends.rows[open_to_doubt], return_inverse=True)
        joint = walls.belief.joint(walls.ids[used])
        known[open_to_doubt] = [not same_line(joint.take(pair), one_wall) for pair in places.reshape(-1, 2)]
    return known


def _bends(walls: StochasticMap, range_m: float, config: VerticesConfig, cut: Collection[tuple[int, int]]) -> _Vertices:
    """Return where bends may lie; walls that begin beyond `range_m` have none that a scan of that range shows."""
    rows = np.flatnonzero((walls.distances_m < range_m) & ~walls.tentative)
    alpha, ends = walls.belief.means[rows, 0], walls.ends_world[rows]
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
    with np.errstate(divide="ignore", invalid="ignore"):
        crossing = gap + across / np.tan(turn)
    cross = (crossing > np.minimum(gap, 0.0) - config.reach_m) & (crossing < np.maximum(gap, 0.0) + config.reach_m)
    at = np.where(cross, crossing, 0.5 * gap)
    points = ends[before, 1] + at[:, None] * directions(alpha[before])
    pair = np.stack([rows[before], rows[after]], axis=-1)
    return _Vertices(pair, points, np.abs(turn), cross, gap < -config.past_m, is_cut[is_bend])


def _are_pairs(ids: Int[np.ndarray, " n"], pairs: Collection[tuple[int, int]]) -> Bool[np.ndarray, "n n"]:
    """Return for each two of the ids, which ascend, whether they are one of the pairs, in either order."""
    are_pairs = np.zeros((len(ids), len(ids)), dtype=bool)
    wanted = np.array(list(pairs), dtype=np.int64).reshape(-1, 2)
    wanted = wanted[np.isin(wanted, ids).all(axis=1)]
    one, other = np.searchsorted(ids, wanted).T
    are_pairs[one, other] = are_pairs[other, one] = True
    return are_pairs
