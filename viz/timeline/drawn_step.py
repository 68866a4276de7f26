"""The part of one step that a timeline keeps: small arrays and references, cheap while the robot drives."""

from dataclasses import dataclass

import networkx as nx
import numpy as np
from jaxtyping import Bool, Float, Int, UInt32

from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.goal import SetAside
from chainslam.explore.goals.decider import Decision
from chainslam.explore.planning.visibility_graph import NEIGHBOUR
from chainslam.explore.step import Step
from chainslam.slam.association.matching import Matches
from chainslam.slam.association.recovery import Localisation
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.map.chains import Chain
from chainslam.slam.robot import RobotSpec, Scan

from .colours import WallColours

EVERY_ALL, EVERY_SEEN = 50, 3
"""Steps between two queries of the covariance of every wall, and of walls just seen."""
EVERY_GRAPH = 20
EVERY_SWEPT = 20
EVERY_OWN_SCAN = 4
"""If the mission has no grid (a replay plans nothing), every n-th scan is drawn into one."""
OWN_CELL_M = 0.1
OWN_REACH_M = 15.0
"""Farther floor is not drawn, since scanners with a longer reach do not see it again."""


@dataclass(frozen=True)
class Ellipses:
    """Walls whose covariance was queried at a step."""

    ids: Int[np.ndarray, " m"]
    means: Float[np.ndarray, "m 2"]
    anchors: Float[np.ndarray, "m 2"]
    covs: Float[np.ndarray, "m 2 2"]
    """Covariance of (alpha, d)."""


NO_ELLIPSES = Ellipses(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2)), np.zeros((0, 2, 2)))


@dataclass(frozen=True)
class Sights:
    """The visibility graph at a step."""

    nodes: tuple[int, ...]
    edges: Int[np.ndarray, "e 2"]
    is_neighbour: Bool[np.ndarray, " e"]


@dataclass(frozen=True)
class Swept:
    """The floor seen free at a step."""

    free: Bool[np.ndarray, "h w"]
    corner_world: Float[np.ndarray, "2"]
    """Corner of the lowest row and first column, m."""
    cell_m: float


@dataclass(frozen=True)
class DrawnWalls:
    """The map at a step."""

    ids: Int[np.ndarray, " n"]
    means: Float[np.ndarray, "n 2"]
    anchors: Float[np.ndarray, "n 2"]
    extents: Float[np.ndarray, "n 2"]
    colours: UInt32[np.ndarray, " n"]
    """Colour of each wall, by its chain."""
    ellipses: Ellipses | None
    chains: tuple[Chain, ...]


@dataclass(frozen=True, kw_only=True)
class DrawnStep:
    """The drawn part of one step."""

    index: int
    time_s: float
    pose: Float[np.ndarray, "3"]
    pose_cov: Float[np.ndarray, "3 3"]
    true_pose: Float[np.ndarray, "3"] | None
    scan: Scan
    segments: Segments
    matches: Matches
    localisation: Localisation
    owners: Int[np.ndarray, " s"]
    walls: DrawnWalls
    decision: Decision
    set_aside: tuple[SetAside, ...]
    ended: str | None
    sights: Sights | None
    swept: Swept | None
    path_length_m: float
    seconds: float
    robot: RobotSpec


class Keeper:
    """Keeps the drawn part of the steps of one back end."""

    def __init__(self) -> None:
        self._own: FreeSpace | None = None
        self._graph_shown: tuple[object, bytes] = ((), b"")
        self._colours = WallColours()
        self._coloured = (np.zeros(0, dtype=np.int64), np.zeros(0, dtype=np.uint32))

    def keep(self, step: Step, true_pose_world: Float[np.ndarray, "3"] | None) -> DrawnStep:
        """Return the drawn part of a step; it queries the step's belief, so call it before the back end continues."""
        belief, walls = step.map.belief, step.map
        last = step.ended is not None
        ids, colours = walls.ids.copy(), self._colours.of_walls(walls, step.chains)
        ellipses = _ellipses(step, last, self._recoloured(ids, colours))
        means, anchors = belief.means.copy(), belief.anchors.copy()
        return DrawnStep(
            index=step.index,
            time_s=step.time_s,
            pose=belief.pose_world.copy(),
            pose_cov=belief.pose_cov.copy(),
            true_pose=true_pose_world,
            scan=step.scan,
            segments=step.segments,
            matches=step.matches,
            localisation=step.localisation,
            owners=step.walls_of_segments,
            walls=DrawnWalls(ids, means, anchors, walls.extents.copy(), colours, ellipses, step.chains),
            decision=step.decision,
            set_aside=step.set_aside,
            ended=step.ended,
            sights=self._sights(step.graph, step.index, last),
            swept=self._swept(step, last),
            path_length_m=step.path_length_m,
            seconds=step.seconds,
            robot=step.robot,
        )

    def _recoloured(self, ids: Int[np.ndarray, " n"], colours: UInt32[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
        """Return which walls are new or have another colour than at the step before."""
        (old_ids, old), self._coloured = self._coloured, (ids, colours)
        if colours is old or not len(old_ids):
            return np.full(len(ids), colours is not old)
        rows = np.minimum(np.searchsorted(old_ids, ids), len(old_ids) - 1)
        return (old_ids[rows] != ids) | (old[rows] != colours)

    def _sights(self, graph: "nx.DiGraph[int]", index: int, last: bool) -> Sights | None:
        if not last and index % EVERY_GRAPH:
            return None
        kinds = [(a, b, says["kind"] == NEIGHBOUR) for a, b, says in graph.edges(data=True)]
        table = np.array(kinds, dtype=np.int64).reshape(-1, 3)
        shown = (tuple(graph.nodes), table.tobytes())
        if shown == self._graph_shown:
            return None
        self._graph_shown = shown
        return Sights(tuple(graph.nodes), table[:, :2], table[:, 2].astype(bool))

    def _swept(self, step: Step, last: bool) -> Swept | None:
        free_space = step.free_space
        if not free_space.evidence.size:
            free_space = self._own = self._own or FreeSpace(FreeSpaceConfig(step.robot, OWN_CELL_M))
            if last or step.index % EVERY_OWN_SCAN == 0:
                is_far = step.scan.range_max_m > OWN_REACH_M
                free_space.integrate(step.pose_world, step.scan.within(OWN_REACH_M) if is_far else step.scan)
        if not last and step.index % EVERY_SWEPT:
            return None
        return _picture(free_space)


def _ellipses(step: Step, last: bool, recoloured: Bool[np.ndarray, " n"]) -> Ellipses | None:
    """Query the covariance of the walls to draw again: just seen, recoloured, at intervals all; None for none."""
    belief = step.map.belief
    ids = belief.ids
    if not last and step.index % EVERY_ALL:
        chosen = recoloured.copy()
        if step.index % EVERY_SEEN == 0 and len(ids):
            owners = step.walls_of_segments
            rows = np.minimum(np.searchsorted(ids, owners), len(ids) - 1)
            chosen[rows[ids[rows] == owners]] = True
        if not chosen.any():
            return None
        ids = ids[chosen]
    joint = belief.joint(ids)
    m = len(ids)
    blocks = joint.cov[3:, 3:].reshape(m, 2, m, 2)[np.arange(m), :, np.arange(m), :]
    return Ellipses(ids, joint.mean[3:].reshape(m, 2), joint.anchors, blocks)


def _picture(free_space: FreeSpace) -> Swept | None:
    """Copy the part of the grid that was seen free."""
    free = free_space.evidence < 0
    rows, columns = np.flatnonzero(free.any(axis=1)), np.flatnonzero(free.any(axis=0))
    if not len(rows):
        return None
    cell = free_space.config.cell_m
    corner = free_space.origin_world + cell * np.array([columns[0], rows[0]])
    return Swept(free[rows[0] : rows[-1] + 1, columns[0] : columns[-1] + 1].copy(), corner, cell)
