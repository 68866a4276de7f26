"""Bends that the map knows, where a scan shows one straight piece.

Near a wall that turns by a degree or two, one line fits dozens of beams of both its parts: a second line saves less
than chance does, and yet the one line is wrong by many of the sigmas that so many beams state, the same way in scan
after scan. The map, which has seen each part alone, knows where to cut.
"""

from collections.abc import Collection
from functools import lru_cache

import numpy as np
from jaxtyping import Bool, Float, Int

from ...estimation.gates import gate_level
from ...estimation.shared import SharedConfig
from ...extraction.segments import Segments
from ...geometry.lines import directions
from ..merging import same_line
from ..stochastic_map import StochasticMap
from .kernels import vertex_kernels
from .kernels.vertex_kernels import Bends, Bounds

LEAST_RAD = float(np.deg2rad(0.2))
"""Smaller turns are no bends: over thousands of beams every real wall shows one, and walls that overlap may be
duplicates."""
SLIGHT_RAD = float(np.deg2rad(2.0))
"""Larger ones a scan may show."""
LARGEST_RAD = float(np.deg2rad(10.0))
"""A sharper bend is seen in every scan."""


def vertices_within(
    segments: Segments,
    walls: StochasticMap,
    one_wall: float,
    shared: SharedConfig = SharedConfig(),
    cut: Collection[tuple[int, int]] = (),
) -> Float[np.ndarray, " b"]:
    """Return the bearings, rad, of the map's bends that lie on a segment, at the pose of the map's belief.

    At the probability level `one_wall` the two sides are not one line: in a straight building two pieces of one wall
    may stand in the map for a while. `cut` are pairs of ids, the lower first, of which it is known that they are two
    walls (`change_points`).
    """
    if not len(segments):
        return np.zeros(0)
    bends = _bends(walls, np.linalg.norm(segments.ends, axis=-1).max(), shared, cut)
    if not len(bends.rows):
        return np.zeros(0)
    alpha_world, pose = walls.belief.means[bends.rows[:, 0], 0], walls.belief.pose_world
    on, bearings = vertex_kernels.on_segments(
        bends.points_world, alpha_world, pose, segments.lines, segments.ends, _bounds(shared)
    )
    return bearings[_are_known(bends, on, walls, one_wall)]


def meetings(
    walls: StochasticMap,
    range_m: float,
    one_wall: float,
    shared: SharedConfig = SharedConfig(),
    cut: Collection[tuple[int, int]] = (),
) -> tuple[Int[np.ndarray, "k 2"], Float[np.ndarray, "k 2"]]:
    """Return ids of walls that overlap, before and after a bend, and how far along each from its anchor they meet, m.

    Within `range_m` of the robot; `one_wall` and `cut` as above. Walls that turn more than slightly are not ended where
    their lines cross, unless they are cut: which of them a beam met is plain, and one may be laid across a step.
    """
    bends = _bends(walls, range_m, shared, cut)
    slight = (bends.turn_rad > LEAST_RAD) & (bends.turn_rad < SLIGHT_RAD)
    asked = bends.overlap & (bends.is_cut | (bends.cross & slight))
    if not asked.any():
        return np.zeros((0, 2), dtype=np.int64), np.zeros((0, 2))
    known = _are_known(bends, asked, walls, one_wall)
    rows = bends.rows[known]
    from_anchor = bends.points_world[known][:, None] - walls.belief.anchors[rows]
    along = np.vecdot(from_anchor, directions(walls.belief.means[rows, 0]))
    # Where the lines cross a little outside the overlap, its end is near enough.
    short, far = walls.extents[rows[:, 1], 0] - along[:, 1], along[:, 0] - walls.extents[rows[:, 0], 1]
    return walls.ids[rows], along + (np.maximum(short, 0.0) - np.maximum(far, 0.0))[:, None]


def mistaken(
    segments: Segments, walls: StochasticMap, gate: float, shared: SharedConfig = SharedConfig()
) -> Int[np.ndarray, " n"]:
    """Return the ids of walls laid across a bend that this scan shows, and few scans before it.

    Two neighbours in it turn, at the probability level `gate`: that they are two, the cut between them tells, too.

    From 4 m the sides of a bend of a few degrees are one line of eight beams; from a step nearer they are two, and the
    clearer of them passes every gate of that line and turns the robot by half the bend.
    """
    seen = segments.lines, segments.cov[:, 0, 0].copy(), segments.ends, segments.is_tentative
    walls_seen = walls.belief.pose_world, walls.belief.means[:, 0].copy(), walls.ends_world
    laid = vertex_kernels.laid_across(*seen, *walls_seen, gate_level(gate, 1), _bounds(shared))
    return walls.ids[laid & ~walls.established]


@lru_cache
def _bounds(shared: SharedConfig) -> Bounds:
    return Bounds(
        float(shared.resolution_m),
        float(shared.beside_m),
        float(shared.thickness_m),
        float(shared.beyond_m),
        float(shared.far_m),
        LARGEST_RAD,
        float(shared.sharp_rad),
    )


def _are_known(
    bends: Bends, asked: Bool[np.ndarray, " b"], walls: StochasticMap, one_wall: float
) -> Bool[np.ndarray, " b"]:
    """Return which of the bends asked for lie between walls that are surely not one straight wall."""
    known = asked & bends.is_cut
    open_to_doubt = np.flatnonzero(asked & ~bends.is_cut)
    if len(open_to_doubt):
        used, places = np.unique(bends.rows[open_to_doubt], return_inverse=True)
        joint = walls.belief.joint(walls.ids[used])
        known[open_to_doubt] = [not same_line(joint.take(pair), one_wall) for pair in places.reshape(-1, 2)]
    return known


def _bends(walls: StochasticMap, range_m: float, shared: SharedConfig, cut: Collection[tuple[int, int]]) -> Bends:
    """Return where bends may lie; walls that begin beyond `range_m` have none that a scan of that range shows."""
    rows = np.flatnonzero((walls.distances_m < range_m) & ~walls.tentative)
    alpha, pairs = walls.belief.means[:, 0].copy(), np.array(sorted(cut), dtype=np.int64).reshape(-1, 2)
    return vertex_kernels.bends(rows, walls.ids, alpha, walls.ends_world, pairs, _bounds(shared))
