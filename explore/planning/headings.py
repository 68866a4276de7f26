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
) -> tuple[Int[np.ndarray, "n 2"], Float[np.ndarray, " n"], float, int] | None:
    """Return cells and headings rad of the cheapest way to the cheapest of some cells, its cost in cells, and to which.

    Cells are (row, column) of `ground.metre`. None where no way leads to any. Without a heading any will do to begin.
    """
    driven = _Driven(ground, room, start, heading_rad)
    cells, at, graph = driven.cells, driven.at, driven.graph
    if at[tuple(start)] < 0:
        return None
    lengths, before, _ = dijkstra(
        graph, indices=COUNT * at[tuple(start)] + driven.begins, return_predecessors=True, min_only=True
    )
    rows = at[tuple(goals.T)]
    at_goals = np.where(rows >= 0, lengths.reshape(-1, COUNT)[rows].min(axis=1), np.inf)
    best = int(np.argmin(at_goals))
    if not np.isfinite(at_goals[best]):
        return None
    node = COUNT * rows[best] + int(np.argmin(lengths.reshape(-1, COUNT)[rows[best]]))
    nodes = [node]
    while (node := int(before[node])) >= 0:
        nodes.append(node)
    way = np.array(nodes[::-1])
    return cells[way // COUNT], HEADINGS_RAD[way % COUNT], float(at_goals[best]), best


def costs_to(
    ground: Ground, room: Room, start: Int[np.ndarray, "2"], heading_rad: float | None, goal: Int[np.ndarray, "2"]
) -> tuple[Float[np.ndarray, "p q k"], Float[np.ndarray, " k"]]:
    """Return what the cheapest way from each cell and heading to a cell costs, in cells, and the headings, ascending.

    Cells as above; infinite where no way leads.
    """
    driven = _Driven(ground, room, start, heading_rad)
    goals = COUNT * driven.at[tuple(goal)] + np.arange(COUNT)
    lengths = dijkstra(driven.graph.T.tocsr(), indices=goals, min_only=True)
    costs = np.full((*ground.metre.shape, COUNT), np.inf)
    order = np.argsort(HEADINGS_RAD)
    costs[tuple(driven.cells.T)] = lengths.reshape(-1, COUNT)[:, order]
    return costs, HEADINGS_RAD[order]


class _Driven:
    """Cells and headings as a graph."""

    def __init__(
        self, ground: Ground, room: Room, start: Int[np.ndarray, "2"], heading_rad: float | None
    ) -> None:
        self.cells = cells = np.argwhere(ground.metre > 0.0)
        self.at = np.full(ground.metre.shape, -1)
        self.at[tuple(cells.T)] = np.arange(len(cells))
        self.begins = np.arange(COUNT) if heading_rad is None else np.array([heading_of(heading_rad)])
        of = ground.occupied, cells + ground.corner, room.robot, ground.cell_m
        fits, has_room = rooms_of(*of, room.squeeze_m), rooms_of(*of, room.margin_m)
        fits[np.ix_(self.at[tuple(np.argwhere(ground.escape).T)], self.begins)] = True
        if self.at[tuple(start)] >= 0:
            fits[self.at[tuple(start)], self.begins] = True
        costs = ground.metre[tuple(cells.T)][:, None] + np.where(has_room, 0.0, room.squeeze_cost)
        self.graph = _graph(cells, self.at, fits, costs, ground.cell_m, room.robot.can_reverse)


def _graph(
    cells: Int[np.ndarray, "n 2"],
    at: Int[np.ndarray, "p q"],
    fits: Bool[np.ndarray, "n k"],
    costs: Float[np.ndarray, "n k"],
    cell_m: float,
    can_reverse: bool,
) -> csr_array:
    """Return what it costs, in cells, to get from one cell and heading to another; nodes count heading by heading."""
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
    return csr_array((lengths, (heads, tails)), shape=(COUNT * len(cells), COUNT * len(cells)))
