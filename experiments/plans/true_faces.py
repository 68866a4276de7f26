"""The true walls in place of mapped ones, so that a dimension of the map can be held against what it really is."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.lines import directions, normals, through
from chainslam.slam.geometry.poses import wrap

from .faces import Faces
from .measuring import Dimension, value_of

MEET_M = 1e-3
"""True walls that are drawn as a corner meet to this."""


def with_truth(
    faces: Faces, face_of: Int[np.ndarray, " n"], true_faces: Float[np.ndarray, "f 2 2"], walls: Int[np.ndarray, " f"]
) -> Faces:
    """Return the same walls with their true lines and ends; `face_of` is the true face of each, -1 for none.

    A wall without a true face keeps its line. `walls` labels true faces that are one wall.
    """
    known = np.flatnonzero(face_of >= 0)
    means, extents = faces.means.copy(), faces.extents.copy()
    lines = through(true_faces[face_of[known]])
    alpha = faces.means[known, 0] + wrap(lines[:, 0] - faces.means[known, 0])
    means[known] = np.stack([alpha, lines[:, 1] - np.vecdot(normals(alpha), faces.anchors[known])], axis=-1)
    for row in known:
        pieces = true_faces[walls == walls[face_of[row]]]
        along = (pieces - faces.anchors[row]) @ directions(means[row, 0])
        for side in (0, 1):
            extents[row, side] = along[np.abs(along[:, side] - faces.extents[row, side]).argmin(), side]
    return replace(faces, means=means, extents=extents)


def true_value(
    dimension: Dimension, truth: Faces, face_of: Int[np.ndarray, " n"], true_faces: Float[np.ndarray, "f 2 2"]
) -> tuple[float | None, bool]:
    """Return what a dimension really is, None where its walls have no such corner, and whether it is as drawn.

    It is not as drawn where a wall of it has no true face, or where a corner of the map is none of the building.
    """
    if any(face_of[row] < 0 for row in dimension.walls):
        return None, False
    corners = {(node.wall, node.other) for ring in dimension.nodes for node in ring if node.other >= 0}
    if any(abs(np.sin(np.diff(truth.means[list(pair), 0])[0])) < np.sin(np.deg2rad(5.0)) for pair in corners):
        return None, False
    mapped = {(node.wall, node.other) for node in truth.corners.values()} & corners
    return value_of(truth, dimension).value, all(_meet(true_faces[face_of[list(pair)]]) for pair in mapped)


def _meet(pair: Float[np.ndarray, "2 2 2"]) -> bool:
    first, second = pair
    return bool(np.hypot(*(first[:, None] - second[None]).reshape(-1, 2).T).min() <= MEET_M)


def held(
    values: Sequence[float], truths: Sequence[float], sigmas: Sequence[float], z: float
) -> Float[np.ndarray, " k"]:
    """Return which intervals hold the truth, as ones and zeros."""
    off = np.abs(np.asarray(values) - np.asarray(truths))
    return np.asarray(off <= z * np.asarray(sigmas), dtype=np.float64)
