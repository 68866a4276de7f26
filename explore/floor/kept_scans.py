"""Scans kept with the walls around them, and where the walls have carried them."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.lines import distance_to_segments, normals
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import Scan

from .carrying_kernels import carried, nearest

NO_PLACES = np.zeros((0, 2))


@dataclass(frozen=True)
class KeptScan:
    """A scan with the nearest walls as they stood around it; `ids` is padded with -1."""

    pose_world: Float[np.ndarray, "3"]
    scan: Scan
    ids: Int[np.ndarray, " w"]
    alphas: Float[np.ndarray, " w"]
    offsets: Float[np.ndarray, " w"]
    """From the pose to each line along its normal, m."""
    way_robot: Float[np.ndarray, "d 2"]
    """Where the robot drove while the scans of this place were taken, in the frame of this one, m."""
    touched_robot: Float[np.ndarray, "t 2"]
    """What its body touched then."""


@dataclass(frozen=True)
class Told:
    """What the walls tell of the motion of each of k scans, as sums by length of wall."""

    length_m: Float[np.ndarray, " k"]
    turn: Float[np.ndarray, " k"]
    normal: Float[np.ndarray, "k 2 2"]
    shift: Float[np.ndarray, "k 2"]

    def motions(self, faith_m: float) -> Float[np.ndarray, "k 3"]:
        """Return (x, y, turn) of each scan by itself, world frame: none where no wall tells."""
        turn = self.turn / (self.length_m + faith_m)
        shift = np.linalg.solve(self.normal + faith_m * np.eye(2), self.shift[..., None])[..., 0]
        return np.column_stack([shift, turn])

    def carried(self, poses_world: Float[np.ndarray, "k 3"], faith_m: float) -> Float[np.ndarray, "k 3"]:
        """Return where the walls carried scans; where they do not tell, a scan moved as one with that before it."""
        moved = carried(poses_world, self.length_m, self.turn, self.normal, self.shift, faith_m)
        moved[:, 2] = wrap(moved[:, 2])
        return moved


def beside(
    walls: StochasticMap,
    poses_world: Float[np.ndarray, "k 3"],
    scans: Sequence[Scan],
    count: int,
    distances_m: Float[np.ndarray, "k n"] | None = None,
) -> list[KeptScan]:
    """Return scans to keep, each with the `count` walls nearest to its pose, given or not how far each wall is."""
    if distances_m is None:
        distances_m = distance_to_segments(poses_world[:, :2], walls.ends_world)
    rows = nearest(distances_m, walls.tentative, count)
    there = rows >= 0
    ids, lines = np.full(rows.shape, -1), np.zeros((*rows.shape, 2))
    ids[there], lines[there] = walls.ids[rows[there]], walls.belief.lines_world[rows[there]]
    offsets = lines[..., 1] - np.vecdot(normals(lines[..., 0]), poses_world[:, None, :2])
    return [
        KeptScan(pose, scan, ids[k], lines[k, :, 0], offsets[k], NO_PLACES, NO_PLACES)
        for k, (pose, scan) in enumerate(zip(poses_world, scans, strict=True))
    ]


def told(walls: StochasticMap, kept: list[KeptScan]) -> Told:
    """Return what the walls, as they stand now, tell of the motion of scans that were kept beside them."""
    ids = np.array([view.ids for view in kept])
    places = np.array([view.pose_world[:2] for view in kept])
    rows = np.minimum(np.searchsorted(walls.ids, ids), max(len(walls) - 1, 0))
    if not len(walls):
        nothing = np.zeros(len(kept))
        return Told(nothing, nothing, np.zeros((len(kept), 2, 2)), np.zeros((len(kept), 2)))
    lines, extents = walls.belief.lines_world[rows], walls.extents[rows]
    length = np.where(walls.ids[rows] == ids, extents[..., 1] - extents[..., 0], 0.0)
    n = normals(lines[..., 0])
    offsets = lines[..., 1] - np.vecdot(n, places[:, None])
    turns = wrap(lines[..., 0] - np.array([view.alphas for view in kept]))
    away = offsets - np.array([view.offsets for view in kept])
    return Told(
        length.sum(axis=1),
        np.vecdot(length, turns),
        np.einsum("kw,kwi,kwj->kij", length, n, n),
        np.einsum("kw,kwi,kw->ki", length, n, away),
    )
