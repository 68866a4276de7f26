"""The cheapest way for a body with an outline: over cells and headings, straight on, back, and turning on the spot."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.sparse import csr_array
from scipy.sparse.csgraph import dijkstra

from chainslam.slam.robot import RobotSpec

from .footprints import AHEAD, HEADINGS_RAD, heading_of, rooms_of

TURN_M = 0.1
"""To turn on the spot to the next heading costs as much as this way."""
BACK = 1.5
"""A metre backwards costs so many times one ahead: nobody sees more of where the robot goes."""
COUNT = len(HEADINGS_RAD)


@dataclass(frozen=True)
class Ground:
    """Where a way is sought."""

    occupied: Bool[np.ndarray, "h w"]
    """What is in the way, in cells of the whole grid."""
    corner: Int[np.ndarray, "2"]
    """The cell of the whole grid that is the first one of `metre`."""
    metre: Float[np.ndarray, "p q"]
    """What a metre costs in each cell; -1 where no way leads."""
    escape: Bool[np.ndarray, "p q"]
    """Cells in which the body, too near to something already, may go on as it stands."""
    cell_m: float


@dataclass(frozen=True)
class Room:
    """How much of it a body asks for."""

    robot: RobotSpec
    squeeze_m: float
    """It fits with so much beyond its outline ..."""
    margin_m: float
    """... and has room enough with this; ..."""
    squeeze_cost: float
    """... with less, a metre costs so much more."""


def cheapest(
    ground: Ground, room: Room, start: Int[np.ndarray, "2"], heading_rad: float | None, goals: Int[np.ndarray, "g 2"]
) -> tuple[Int[np.ndarray, "n 2"], Float[np.ndarray, " n"], Float[np.ndarray, "p q k"]] | None:
    """Return cells and headings rad of the cheapest way to the cheapest of some cells, and what each way costs.

    Cells are (row, column) of `ground.metre`, and costs are in cells, infinite where no way leads. None where none
    leads to any from the start. Without a heading any will do to begin.
    """
    cells = np.argwhere(ground.metre > 0.0)
    at = np.full(ground.metre.shape, -1)
    at[tuple(cells.T)] = np.arange(len(cells))
    if at[tuple(start)] < 0:
        return None
    of = ground.occupied, cells + ground.corner, room.robot, ground.cell_m
    fits, has_room = rooms_of(*of, room.squeeze_m), rooms_of(*of, room.margin_m)
    begins = np.arange(COUNT) if heading_rad is None else np.array([heading_of(heading_rad)])
    fits[np.ix_(at[tuple(np.argwhere(ground.escape).T)], begins)] = True
    fits[at[tuple(start)], begins] = True
    costs = ground.metre[tuple(cells.T)][:, None] + np.where(has_room, 0.0, room.squeeze_cost)
    graph = _graph(cells, at, fits, costs, ground.cell_m, room.robot.can_reverse)
    rows = at[tuple(goals.T)]
    ends = np.unique(COUNT * rows[rows >= 0, None] + np.arange(COUNT))
    lengths, after, _ = dijkstra(graph, indices=ends, return_predecessors=True, min_only=True)
    nodes = COUNT * at[tuple(start)] + begins
    node = int(nodes[np.argmin(lengths[nodes])])
    if not np.isfinite(lengths[node]):
        return None
    nodes = [node]
    while (node := int(after[node])) >= 0:
        nodes.append(node)
    way, everywhere = np.array(nodes), np.full((*ground.metre.shape, COUNT), np.inf)
    everywhere[tuple(cells.T)] = lengths.reshape(-1, COUNT)
    return cells[way // COUNT], HEADINGS_RAD[way % COUNT], everywhere


def _graph(
    cells: Int[np.ndarray, "n 2"],
    at: Int[np.ndarray, "p q"],
    fits: Bool[np.ndarray, "n k"],
    costs: Float[np.ndarray, "n k"],
    cell_m: float,
    can_reverse: bool,
) -> csr_array:
    """Return what it costs, in cells, to get to one cell and heading from another; nodes count heading by heading."""
    edges: list[tuple[Int[np.ndarray, " e"], Int[np.ndarray, " e"], Float[np.ndarray, " e"]]] = []
    padded = np.pad(at, 2, constant_values=-1)
    every = np.arange(len(cells))
    for k, (columns, rows) in enumerate(AHEAD.tolist()):
        onto = padded[cells[:, 0] + 2 + rows, cells[:, 1] + 2 + columns]
        may = fits[:, k] & (onto >= 0) & fits[onto, k]
        first, last = every[may], onto[may]
        metres = 0.5 * (costs[first, k] + costs[last, k]) * float(np.hypot(columns, rows))
        edges.append((COUNT * first + k, COUNT * last + k, metres))
        if can_reverse:
            edges.append((COUNT * last + k, COUNT * first + k, BACK * metres))
        beside = (k + 1) % COUNT
        both = every[fits[:, k] & fits[:, beside]]
        turn = np.full(len(both), TURN_M / cell_m)
        edges += [(COUNT * both + k, COUNT * both + beside, turn), (COUNT * both + beside, COUNT * both + k, turn)]
    heads, tails, lengths = (np.concatenate(each) for each in zip(*edges, strict=True))
    return csr_array((lengths, (tails, heads)), shape=(COUNT * len(cells), COUNT * len(cells)))
