"""The true walls in place of mapped ones, so that a dimension of the map can be held against what it really is."""

from dataclasses import replace

import numpy as np
import shapely
from jaxtyping import Float, Int

from chainslam.experiments.views.plans.faces import Faces, Node
from chainslam.experiments.views.plans.measuring import Dimension, Kind, value_of
from chainslam.slam.geometry.lines import directions, normals, project, through
from chainslam.slam.geometry.poses import wrap

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
    dimension: Dimension, truth: Faces, mapped: Faces, face_of: Int[np.ndarray, " n"],
    true_faces: Float[np.ndarray, "f 2 2"],
) -> tuple[float | None, bool]:  # fmt: skip
    """Return what a dimension really is, None where its walls have no such corner, and whether it is as drawn.

    It is not as drawn where a wall of it has no true face, or where a corner of the map is none of the building. A room
    has an area and an outline all the same: a corner between two pieces of one true wall is anywhere on it.
    """
    if any(face_of[row] < 0 for row in dimension.walls):
        return None, False
    nodes = [node for ring in dimension.nodes for node in ring]
    false = {node for node in nodes if node.other >= 0 and _is_parallel(truth, node)}
    corners = {(node.wall, node.other) for node in truth.corners.values()} & {(each.wall, each.other) for each in nodes}
    exists = not false and all(_meet(true_faces[face_of[list(pair)]]) for pair in corners)
    if dimension.kind in (Kind.AREA, Kind.PERIMETER):
        rings = [np.array([_place(truth, mapped, node, node in false) for node in ring]) for ring in dimension.nodes]
        outline = shapely.Polygon(rings[0], rings[1:])
        return (outline.area if dimension.kind is Kind.AREA else outline.exterior.length), exists
    return (None if false else value_of(truth, dimension).value), exists


def _is_parallel(truth: Faces, node: Node) -> bool:
    turn = truth.means[node.other, 0] - truth.means[node.wall, 0]
    return bool(abs(np.sin(turn)) < np.sin(np.deg2rad(5.0)))


def _place(truth: Faces, mapped: Faces, node: Node, is_false: bool) -> Float[np.ndarray, "2"]:
    return project(mapped.place(node), truth.lines_world[node.wall]) if is_false else truth.place(node)


def _meet(pair: Float[np.ndarray, "2 2 2"]) -> bool:
    first, second = pair
    return bool(np.hypot(*(first[:, None] - second[None]).reshape(-1, 2).T).min() <= MEET_M)
