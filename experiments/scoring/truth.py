"""The true walls of a world for the scores, computed once per world."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from jaxtyping import Float, Int
from scipy.sparse import coo_array
from scipy.sparse.csgraph import connected_components
from scipy.spatial import cKDTree

from chainslam.sim.robot import RobotConfig
from chainslam.sim.worlds import Contour, World
from chainslam.slam.geometry.lines import normals, through

SAME_LINE_M = 0.005
"""Faces whose ends lie this near to each other's line, on the same side, are one wall: half a beam's sigma."""
SAME_LINE_RAD = np.deg2rad(1.0)


@dataclass(frozen=True, eq=False)
class Truth:
    """A world's faces, which of them are one wall, and what a robot can see of them."""

    world: World
    faces: Float[np.ndarray, "n 2 2"]
    lines: Float[np.ndarray, "n 2"]
    """(alpha rad, r m) of each face, world frame."""
    walls: Int[np.ndarray, " n"]
    """The wall of each face: collinear faces on one side share one."""
    rings: Int[np.ndarray, " n"]
    """The ring (contour) of each face."""
    contour: Contour
    """The reachable contour."""


@lru_cache(maxsize=4)
def truth_of(world: World, config: RobotConfig) -> Truth:
    """Return the truth about a world for a robot of this body and range finder."""
    lines = through(world.faces)
    contour = world.reachable_contour(config.half_width_m, config.lidar.range_max_m, config.true_scanner.off_m)
    return Truth(world, world.faces, lines, collinear(world.faces), world.face_rings, contour)


def collinear(faces: Float[np.ndarray, "n 2 2"]) -> Int[np.ndarray, " n"]:
    """Return a label for each face, the same for faces on one line and one side of it."""
    centred = faces - faces.reshape(-1, 2).mean(axis=0)
    lines = through(centred)
    size = max(float(np.abs(centred).max()), 1.0)
    # Near in (n, r): a turn by SAME_LINE_RAD moves r by at most the size of the world times it.
    reach = SAME_LINE_RAD + SAME_LINE_M / size
    features = np.column_stack([normals(lines[:, 0]), lines[:, 1] / size])
    pairs = cKDTree(features).query_pairs(2.0 * reach, output_type="ndarray")
    i, j = pairs[:, 0], pairs[:, 1]
    off = np.maximum(_offset(centred[i], lines[j]), _offset(centred[j], lines[i]))
    same = (off <= SAME_LINE_M) & (np.cos(lines[i, 0] - lines[j, 0]) >= np.cos(SAME_LINE_RAD))
    links = coo_array((np.ones(int(same.sum())), (i[same], j[same])), shape=(len(faces), len(faces)))
    return connected_components(links)[1].astype(np.int64)


def _offset(faces: Float[np.ndarray, "m 2 2"], lines: Float[np.ndarray, "m 2"]) -> Float[np.ndarray, " m"]:
    """Return the larger distance of a face's ends from a line, m."""
    across = np.vecdot(faces, normals(lines[:, 0])[:, None]) - lines[:, 1, None]
    return np.asarray(np.abs(across).max(axis=1))
