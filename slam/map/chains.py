"""Segments joined end to end: chains, their open ends, closed contours (paper, sections 2 and 2.2)."""

from collections.abc import Collection
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.shared import SharedConfig
from .kernels.chain_kernels import HEAD as HEAD
from .kernels.chain_kernels import TAIL as TAIL
from .kernels.chain_kernels import Reach, linked
from .stochastic_map import StochasticMap


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
    shared: SharedConfig = SharedConfig(),
) -> tuple[Chain, ...]:
    """Join heads to tails, nearest first, and return the chains in the order of their oldest wall.

    Free side on the left throughout, so a head joins only a tail. `set_aside` holds (wall id, side) of ends that
    were looked at closely: two of these may join across a wider gap (a missed short face).
    """
    rows = (~walls.tentative).nonzero()[0]
    if not len(rows):
        return ()
    ends, ids, lines = walls.ends_world[rows], walls.ids[rows], (walls.belief.anchors[rows], walls.belief.means[rows])
    near_m, corner_m = float(max(shared.thickness_m, shared.door_m)), float(shared.short_m)
    walked, starts, closed, corners = linked(ends, *lines, _aside(ids, set_aside), near_m, corner_m, _reach(shared))
    names, ends = ids[walked].tolist(), ends[walked]
    chains = [
        _chain(tuple(names[start:stop]), is_closed, ends[start:stop], corners[start:stop])
        for (start, stop), is_closed in zip(pairwise(starts.tolist()), closed.tolist(), strict=True)
    ]
    return tuple(chains)


def _aside(ids: Int[np.ndarray, " n"], set_aside: Collection[tuple[int, int]]) -> Bool[np.ndarray, "n 2"]:
    """Return which ends of walls were set aside."""
    aside = np.zeros((len(ids), 2), dtype=bool)
    if not set_aside:
        return aside
    named, sides = np.array(list(set_aside)).T
    rows = np.minimum(np.searchsorted(ids, named), len(ids) - 1)
    there = ids[rows] == named
    aside[rows[there], sides[there]] = True
    return aside


def _reach(shared: SharedConfig) -> Reach:
    return Reach(float(shared.thickness_m), float(shared.door_m))


def _chain(
    walls: tuple[int, ...], closed: bool, ends: Float[np.ndarray, "m 2 2"], corners: Float[np.ndarray, "m 2"]
) -> Chain:
    """Return the chain of these walls; `corners` holds where each of them meets the next."""
    if closed:
        return Chain(walls, corners, ())
    return Chain(
        walls, corners[:-1], (OpenEnd(walls[0], TAIL, ends[0, TAIL]), OpenEnd(walls[-1], HEAD, ends[-1, HEAD]))
    )
