"""The wall faces of a saved map: lines with their joint covariance, where they begin and end, and how they are chained.

Everything that a plan measures is a function of these lines. The same function of the true lines is the true dimension.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from jaxtyping import Bool, Float, Int
from shapely.geometry.base import BaseGeometry

from chainslam.sim.worlds import WorldError
from chainslam.sim.worlds.readers.ros_map import read_ros_map
from chainslam.sim.worlds.solid import solid_of
from chainslam.slam.estimation.backend import POSE, columns_of
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.map.chains import HEAD, TAIL

from ...artifacts.maps.map_files import read_joint
from ...scoring.maps.measurements import PARALLEL, CornerPoints, corner_jacobian, corner_points
from ...usage import UsageError

END = -1
"""In place of the second wall of a node that is no corner."""
END_SIGMA_M = 0.035
"""Standard deviation of an end where no other wall is met, in apartments: beams stand apart."""
BIAS_M = 1e-4
"""Standard deviation, beside the stated one, of where each wall stands: fits of lines are biased by about as much,
which shows where a wall is known to a few tenths of a millimetre (`make dimensions`)."""
MEET_M = 0.3
"""Two neighbours of a chain make a corner if their lines cross this near to both their ends."""


class Node(NamedTuple):
    """A point of the plan: where two walls meet, or where one stops."""

    wall: int
    """Row of the wall."""
    other: int = END
    """Row of the wall whose line crosses there; `END` where the wall just stops."""
    side: int = HEAD
    """Which end of the wall it is."""


@dataclass(frozen=True)
class Faces:
    """Confirmed walls, n of them, each seen from one side."""

    ids: Int[np.ndarray, " n"]
    means: Float[np.ndarray, "n 2"]
    """(alpha rad, d m) about the anchor; the normal alpha points from the free side into the wall."""
    anchors: Float[np.ndarray, "n 2"]
    extents: Float[np.ndarray, "n 2"]
    """From and to along the wall, m, from its anchor."""
    cov: Float[np.ndarray, "s s"]
    """Joint covariance of the pose and these lines, s = 3 + 2 n."""
    chains: tuple[tuple[int, ...], ...]
    """Rows of each chain, in order, free side on the left."""
    closed: tuple[bool, ...]
    pose_world: Float[np.ndarray, "3"]

    def __len__(self) -> int:
        return len(self.ids)

    @cached_property
    def lines_world(self) -> Float[np.ndarray, "n 2"]:
        """(alpha rad, r m) of each line."""
        r = self.means[:, 1] + np.vecdot(normals(self.means[:, 0]), self.anchors)
        return np.stack([self.means[:, 0], r], axis=-1)

    @cached_property
    def stops_world(self) -> Float[np.ndarray, "n 2 2"]:
        """Where each wall was seen to begin and to end, m."""
        feet = self.anchors + self.means[:, 1:] * normals(self.means[:, 0])
        return feet[:, None] + self.extents[..., None] * directions(self.means[:, 0])[:, None]

    @property
    def neighbours(self) -> list[tuple[int, int]]:
        """Each wall of a chain and the next, around a closed one."""
        return [
            pair for chain, closed in zip(self.chains, self.closed, strict=True)
            for pair in pairwise((*chain, *chain[:1]) if closed else chain)
        ]  # fmt: skip

    @cached_property
    def corners(self) -> dict[tuple[int, int], Node]:
        """The corner at each end (wall, side) that has one."""
        found = {}
        for before, after in self.neighbours:
            if before != after and self._meet(before, after):
                found[before, HEAD] = found[after, TAIL] = Node(before, after)
        return found

    def _meet(self, before: int, after: int) -> bool:
        if abs(np.sin(self.means[before, 0] - self.means[after, 0])) < PARALLEL:
            return False
        corner = crossing(self.lines_world[[before, after]])
        ends = self.stops_world[[before, after], [HEAD, TAIL]]
        return bool(np.hypot(*(ends - corner).T).max() <= MEET_M)

    def node(self, wall: int, side: int) -> Node:
        """Return the corner at an end of a wall, or the end itself."""
        return self.corners.get((wall, side), Node(wall, END, side))

    def place(self, node: Node) -> Float[np.ndarray, "2"]:
        """Return where a node is, m."""
        if node.other == END:
            return np.asarray(self.stops_world[node.wall, node.side])
        return crossing(self.lines_world[[node.wall, node.other]])

    @cached_property
    def ends_world(self) -> Float[np.ndarray, "n 2 2"]:
        """First and last point of each wall, m: its corners, where it has some."""
        sides = [[self.place(self.node(wall, side)) for side in (TAIL, HEAD)] for wall in range(len(self))]
        return np.array(sides).reshape(-1, 2, 2)

    @cached_property
    def lengths_m(self) -> Float[np.ndarray, " n"]:
        """How long each wall is."""
        return np.hypot(*(self.ends_world[:, 1] - self.ends_world[:, 0]).T)

    def is_convex(self, wall: int, side: int) -> bool:
        """Return whether the next wall turns away from the free floor: the end of a wall, such as a door's side."""
        node = self.corners.get((wall, side))
        return node is not None and bool(np.sin(self.means[node.other, 0] - self.means[node.wall, 0]) < 0.0)

    def points(self, nodes: Sequence[Node]) -> CornerPoints:
        """Return where nodes are, with their joint covariance; an end is known along its wall to `END_SIGMA_M`."""
        positions = np.array([self.place(node) for node in nodes]).reshape(-1, 2)
        jacobians = np.zeros((len(nodes), 2, POSE + 2 * len(self)))
        for k, node in enumerate(nodes):
            rows = [node.wall] if node.other == END else [node.wall, node.other]
            for row, part in zip(rows, self._jacobian(node, positions[k]), strict=True):
                jacobians[k, :, POSE + 2 * row : POSE + 2 * row + 2] += part
        found = corner_points(positions, jacobians, self.cov)
        alone = [k for k, node in enumerate(nodes) if node.other == END]
        along = directions(self.means[[nodes[k].wall for k in alone], 0])
        found.cov[alone, :, alone, :] += END_SIGMA_M**2 * along[:, :, None] * along[:, None, :]
        return found

    def _jacobian(self, node: Node, at_world: Float[np.ndarray, "2"]) -> list[Float[np.ndarray, "2 2"]]:
        """Return the derivative of a node by the (alpha, d) of each of its walls."""
        if node.other == END:
            alpha, d = self.means[node.wall]
            n, t = normals(alpha), directions(alpha)
            along = self.extents[node.wall, node.side]
            return [np.stack([d * t - along * n, n], axis=-1)]
        rows = [node.wall, node.other]
        own, _ = corner_jacobian(self.means[rows], self.anchors[rows], at_world)
        return [own[:, :2], own[:, 2:]]


def crossing(lines: Float[np.ndarray, "2 2"]) -> Float[np.ndarray, "2"]:
    """Return where two lines (alpha, r) cross."""
    return np.asarray(np.linalg.solve(normals(lines[:, 0]), lines[:, 1]))


def read_faces(folder: Path) -> Faces:
    """Read the map of a run or of a replayed log; raises UsageError for anything else, and for a lost covariance."""
    arrays, features = read_joint(folder)
    return faces_of(arrays, features["chain"])


def read_solid(folder: Path) -> BaseGeometry | None:
    """Return all that the robot did not see free, from a run's ROS map, in the frame of the map; None without one."""
    path = folder / "map.yaml"
    try:
        return solid_of(read_ros_map(path)) if path.exists() else None
    except WorldError as error:
        raise UsageError(f"{error} (in {path})") from error


def faces_of(arrays: Mapping[str, Any], chains: Sequence[Mapping[str, Any]]) -> Faces:
    """Return the confirmed walls of a map, from what `map.npz` and the chains of `map.geojson` hold."""
    told = sorted((f["properties"] for f in chains), key=lambda chain: int(chain["chain"]))
    chained = np.isin(arrays["ids"], [wall for chain in told for wall in chain["walls"]])
    rows: Int[np.ndarray, " n"] = np.flatnonzero(_sound(arrays) & chained)
    of = {int(arrays["ids"][row]): k for k, row in enumerate(rows)}
    kept = [tuple(of[wall] for wall in chain["walls"] if wall in of) for chain in told]
    columns = columns_of(rows)
    cov = arrays["cov"][columns[:, None], columns].copy()
    cov[POSE + 1 :: 2, POSE + 1 :: 2] += BIAS_M**2 * np.eye(len(rows))
    return Faces(
        arrays["ids"][rows], arrays["lines"][rows], arrays["anchors"][rows], arrays["extents"][rows],
        cov, tuple(kept),
        tuple(bool(chain["closed"]) and len(own) == len(chain["walls"]) for chain, own in zip(told, kept, strict=True)),
        arrays["pose"],
    )  # fmt: skip


def _sound(arrays: Mapping[str, Any]) -> Bool[np.ndarray, " n"]:
    return np.asarray(~arrays["tentative"] & (arrays["extents"][:, 1] > arrays["extents"][:, 0]))
