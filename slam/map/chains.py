"""Segments joined end to end: chains, their open ends, closed contours (paper, sections 2 and 2.2)."""

from collections.abc import Collection
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.spatial import cKDTree

from ..geometry.lines import directions, intersect, normals
from .stochastic_map import StochasticMap

TAIL, HEAD = 0, 1
"""The two ends of a wall: walking from tail to head, the free side is on the left."""


BESIDE_SHARE = 0.5
"""Ends of parallel walls that stand apart by this share of the gap across them are a step, not one wall with a hole."""


@dataclass(frozen=True)
class ChainConfig:
    """When the head of one wall and the tail of another are one corner."""

    reach_m: float = 0.1
    """Largest distance between two ends that are joined while the robot still explores them."""
    set_aside_reach_m: float = 0.35
    """The same for two ends that exploration looked at closely and set aside."""
    straight_rad: float = float(np.deg2rad(5.0))
    """Walls that turn less than this into each other make no corner ..."""
    straight_reach_m: float = 0.07
    """... and join only this near, or beside each other: two rooms' walls on one line face each other across the end of
    the wall between, as far apart as that is thick."""
    overlap_m: float = 1.0
    """Largest overlap of the two sides of a bend, both established: within the noise each reaches past it ..."""
    beside_m: float = 0.04
    """... where it lies no farther than this from the other: four sigmas of a beam."""
    bend_rad: tuple[float, float] = (float(np.deg2rad(1.0)), float(np.deg2rad(30.0)))
    """What such a bend turns: less, and it may be one wall entered twice; more, and beams tell where it is."""
    corner_reach_m: float = 0.3
    """A corner is the intersection of the two lines where that lies this near to both ends, else their middle."""


@dataclass(frozen=True)
class OpenEnd:
    """An end of a chain: the successor of this wall is still missing there."""

    wall: int
    """Id of the wall."""
    side: int
    """`TAIL` or `HEAD`."""
    position_world: Float[np.ndarray, "2"]
    """Where the wall stops, m."""


@dataclass(frozen=True)
class Chain:
    """Walls joined head to tail."""

    walls: tuple[int, ...]
    """Ids in order, free side on the left."""
    corners_world: Float[np.ndarray, "c 2"]
    """Where neighbours meet, in order, m; for a closed chain the last one joins the last wall to the first."""
    open_ends: tuple[OpenEnd, ...]
    """Two for an open chain (tail of the first wall, head of the last), none for a closed one."""

    @property
    def is_closed(self) -> bool:
        """Whether the chain surrounds a contour."""
        return not self.open_ends


def connect(
    walls: StochasticMap,
    set_aside: Collection[tuple[int, int]] = (),
    passed: Collection[tuple[int, int]] = (),
    cut_off: Collection[tuple[int, int]] = (),
    config: ChainConfig = ChainConfig(),
) -> tuple[Chain, ...]:
    """Join heads to tails, nearest first, and return the chains in the order of their oldest wall.

    Free side on the left throughout, so a head joins only a tail. `set_aside` holds (wall id, side) of ends that
    were looked at closely: two of these may join across a wider gap (a missed short face), unless it is among those
    that beams have `passed`, (id of the head's wall, id of the tail's). Where beams have `cut_off` the corner in
    which two lines cross, their ends do not join however near they are: a face between them was missed.
    """
    rows = np.flatnonzero(~walls.tentative)
    if not len(rows):
        return ()
    ends, lines, ids = walls.ends_world[rows], walls.belief.lines_world[rows], walls.ids[rows]
    often = walls.established[rows]
    successor = _links(ends, lines, ids, often, set_aside, passed, cut_off, config)
    before = np.flatnonzero(successor >= 0)
    after = successor[before]
    corners = np.full((len(rows), 2), np.nan)
    corners[before] = corner_points(
        lines[before], lines[after], ends[before, HEAD], ends[after, TAIL], config.corner_reach_m
    )
    return tuple(_chain(run, closed, ends, corners, ids) for run, closed in _runs(successor))


def _links(
    ends: Float[np.ndarray, "n 2 2"],
    lines: Float[np.ndarray, "n 2"],
    ids: Int[np.ndarray, " n"],
    often: Bool[np.ndarray, " n"],
    set_aside: Collection[tuple[int, int]],
    passed: Collection[tuple[int, int]],
    cut_off: Collection[tuple[int, int]],
    config: ChainConfig,
) -> Int[np.ndarray, " n"]:
    """Return the row of each wall's successor, -1 for none: greedily, nearest ends first."""
    reach = max(config.reach_m, config.set_aside_reach_m, config.overlap_m)
    near = cKDTree(ends[:, HEAD]).sparse_distance_matrix(cKDTree(ends[:, TAIL]), reach, output_type="ndarray")
    head, tail, gap = near["i"], near["j"], near["v"]
    aside = np.isin(2 * ids[:, None] + [TAIL, HEAD], [2 * wall + side for wall, side in set_aside])
    both_aside = aside[head, HEAD] & aside[tail, TAIL]
    for k in np.flatnonzero(both_aside):
        both_aside[k] = (ids[head[k]], ids[tail[k]]) not in passed
    allowed = (head != tail) & (gap <= np.where(both_aside, config.set_aside_reach_m, config.reach_m))
    straight = np.cos(lines[head, 0] - lines[tail, 0]) > np.cos(config.straight_rad)
    across = np.abs(np.vecdot(normals(lines[head, 0]), ends[tail, TAIL] - ends[head, HEAD]))
    allowed &= ~straight | (gap <= config.straight_reach_m) | (across > BESIDE_SHARE * gap)
    allowed |= (
        (gap <= config.overlap_m)
        & (often[head] & often[tail])
        & _overlap_at_a_bend(ends[head], ends[tail], lines[head, 0], lines[tail, 0], config)
    )
    for k in np.flatnonzero(allowed) if cut_off else ():
        allowed[k] = (ids[head[k]], ids[tail[k]]) not in cut_off
    order = np.flatnonzero(allowed)[np.lexsort((tail[allowed], head[allowed], gap[allowed]))]
    successor, taken = [-1] * len(ids), [False] * len(ids)
    for before, after in zip(head[order].tolist(), tail[order].tolist(), strict=True):
        if successor[before] < 0 and not taken[after]:
            successor[before], taken[after] = after, True
    return np.array(successor)


def _overlap_at_a_bend(
    before: Float[np.ndarray, "k 2 2"],
    after: Float[np.ndarray, "k 2 2"],
    alpha_before: Float[np.ndarray, " k"],
    alpha_after: Float[np.ndarray, " k"],
    config: ChainConfig,
) -> Bool[np.ndarray, " k"]:
    """Return which walls, given by their ends, are the sides of a bend past which they reach, each along the other."""
    t_before, t_after = directions(alpha_before), directions(alpha_after)
    overlap = before[:, HEAD] - after[:, TAIL]
    goes_on = np.vecdot(t_before, after[:, HEAD] - before[:, HEAD]) > 0.0
    goes_on &= np.vecdot(t_after, after[:, TAIL] - before[:, TAIL]) > 0.0
    least, most = np.cos(config.bend_rad)
    turn = np.cos(alpha_after - alpha_before)
    bends = goes_on & (np.vecdot(t_before, overlap) > 0.0) & (turn < least) & (turn > most)
    bends &= np.abs(np.vecdot(normals(alpha_before), overlap)) <= config.beside_m
    return bends & (np.abs(np.vecdot(normals(alpha_after), overlap)) <= config.beside_m)


def _runs(successor: Int[np.ndarray, " n"]) -> list[tuple[list[int], bool]]:
    """Follow the links: rows of each chain in order, and whether it is closed."""
    has_predecessor = np.zeros(len(successor), dtype=bool)
    has_predecessor[successor[successor >= 0]] = True
    following = successor.tolist()
    done = [False] * len(following)
    runs: list[tuple[list[int], bool]] = []
    for start in [*np.flatnonzero(~has_predecessor).tolist(), *range(len(following))]:
        if done[start]:
            continue
        run, row = [], start
        while row >= 0 and not done[row]:
            done[row] = True
            run.append(row)
            row = following[row]
        runs.append((run, row == start))
    return sorted(runs, key=lambda item: min(item[0]))


def _chain(
    run: list[int],
    closed: bool,
    ends: Float[np.ndarray, "n 2 2"],
    corners: Float[np.ndarray, "n 2"],
    ids: Int[np.ndarray, " n"],
) -> Chain:
    """Return the chain of these rows; `corners` holds where each wall meets its successor."""
    walls = tuple(ids[run].tolist())
    if closed:
        return Chain(walls, corners[run], ())
    tail, head = OpenEnd(walls[0], TAIL, ends[run[0], TAIL]), OpenEnd(walls[-1], HEAD, ends[run[-1], HEAD])
    return Chain(walls, corners[run[:-1]], (tail, head))


def corner_points(
    lines_before: Float[np.ndarray, "n 2"],
    lines_after: Float[np.ndarray, "n 2"],
    heads: Float[np.ndarray, "n 2"],
    tails: Float[np.ndarray, "n 2"],
    reach_m: float,
) -> Float[np.ndarray, "n 2"]:
    """Return where neighbouring walls meet: the intersection of their lines if it lies near both ends."""
    crossing, parallel = intersect(lines_before, lines_after)
    far = np.maximum(np.hypot(*(crossing - heads).T), np.hypot(*(crossing - tails).T)) > reach_m
    return np.where((parallel | far)[:, None], 0.5 * (heads + tails), crossing)
