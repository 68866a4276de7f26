"""The reachable contour: the parts of faces that are visible from reachable positions."""

from dataclasses import dataclass

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int

PITCH_M = 0.03
"""Spacing of the points at which visibility is tested; the ends of visible parts are then refined."""
HALVINGS = 6
FAN_RAD = np.deg2rad(1.0)
COARSE = 12
"""Every n-th ray of the fan is tried first."""
BESIDE_RAD = 1e-6
REACH_M = 0.002
"""Arcs of the reachable region are polygons; a point this much farther than the radius still counts as touched."""


@dataclass(frozen=True, eq=False)
class Contour:
    """The visible part of each face."""

    face: Int[np.ndarray, " m"]
    """Index of the face on which each interval lies, ascending."""
    span_m: Float[np.ndarray, "m 2"]
    """Where each interval begins and ends, m along its face."""
    segments: Float[np.ndarray, "m 2 2"]
    """The intervals as points, m, world frame, free side on the left."""
    rings: Int[np.ndarray, " c"]
    """Rings with a visible part of at least 0.1 m, or half of a shorter ring; within the fence, where there is one."""

    @property
    def length_m(self) -> float:
        """Total length of all intervals."""
        return float(np.sum(self.span_m[:, 1] - self.span_m[:, 0]))

    @property
    def contours(self) -> int:
        """Number of rings with a visible part of at least 0.1 m, or half of a shorter ring."""
        return len(self.rings)


@dataclass(frozen=True, eq=False)
class _Scene:
    """Occluding faces, edges of the reachable region as viewpoints, and the range."""

    faces: Float[np.ndarray, "n 2 2"]
    lookouts: Float[np.ndarray, "l 2 2"]
    faces_tree: shapely.STRtree
    lookouts_tree: shapely.STRtree
    radius_m: float
    range_m: float


def visible_contour(
    faces: Float[np.ndarray, "n 2 2"],
    face_rings: Int[np.ndarray, " n"],
    reachable: shapely.Polygon,
    radius_m: float,
    range_m: float,
) -> Contour:
    """Return the parts of `faces` in line of sight within `range_m` of a point of `reachable`, m, world frame.

    Whatever the region sees, its boundary sees, since a sight line leaves the region through it; and a face point
    that the disc can touch is seen by the disc's centre. Only the rest, a few percent, needs rays.
    """
    if reachable.is_empty:
        return _intervals(faces, face_rings, [np.zeros((0, 2))] * len(faces))
    scene = _scene(faces, reachable, radius_m, range_m)
    lengths = np.hypot(*(faces[:, 1] - faces[:, 0]).T)
    counts = np.maximum(np.ceil(lengths / PITCH_M).astype(int), 2)
    face = np.repeat(np.arange(len(faces)), counts)
    first = np.cumsum(counts) - counts
    share = (np.arange(len(face)) - first[face] + 0.5) / counts[face]
    seen = _seen(scene, face, share)
    turns = np.flatnonzero((seen[:-1] != seen[1:]) & (face[:-1] == face[1:]))
    edge = _refine(scene, face[turns], share[turns], share[turns + 1], seen[turns])
    spans = []
    for i in range(len(faces)):
        mine = slice(*np.searchsorted(face[turns], [i, i + 1]))
        marks = list(edge[mine])
        if seen[first[i]]:
            marks.insert(0, 0.0)
        if seen[first[i] + counts[i] - 1]:
            marks.append(1.0)
        spans.append(np.array(marks).reshape(-1, 2) * lengths[i])
    return _intervals(faces, face_rings, spans)


def _scene(faces: Float[np.ndarray, "n 2 2"], reachable: shapely.Polygon, radius_m: float, range_m: float) -> _Scene:
    coarse = reachable.simplify(0.5 * REACH_M)
    rings = [shapely.get_coordinates(ring) for ring in shapely.get_rings(coarse)]
    lookouts = np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])
    trees = [shapely.STRtree(np.array(shapely.linestrings(edges))) for edges in (faces, lookouts)]
    return _Scene(faces, lookouts, trees[0], trees[1], radius_m, range_m)


def _seen(scene: _Scene, face: Int[np.ndarray, " k"], share: Float[np.ndarray, " k"]) -> Bool[np.ndarray, " k"]:
    """Return which points, given as shares along their faces, are visible from the reachable region."""
    ends = scene.faces[face]
    points = ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0])
    touched = scene.lookouts_tree.query(shapely.points(points), predicate="dwithin", distance=scene.radius_m + REACH_M)
    seen = np.zeros(len(face), dtype=bool)
    seen[touched[0]] = True
    rest = np.flatnonzero(~seen)
    order = rest[np.argsort(face[rest], kind="stable")]
    for group in np.split(order, np.flatnonzero(np.diff(face[order])) + 1) if len(order) else []:
        for part in np.array_split(group, len(group) // 64 + 1):
            seen[part] = _fan_sees(scene, int(face[part[0]]), points[part])
    return seen


def _fan_sees(scene: _Scene, face: int, points: Float[np.ndarray, "p 2"]) -> Bool[np.ndarray, " p"]:
    """Return which points of one face look out, along some ray, into the reachable region before hitting a wall."""
    hull = shapely.LineString(points) if len(points) > 1 else shapely.Point(points[0])
    walls = scene.faces[scene.faces_tree.query(hull, predicate="dwithin", distance=scene.range_m)]
    lookouts = scene.lookouts[scene.lookouts_tree.query(hull, predicate="dwithin", distance=scene.range_m)]
    along = scene.faces[face, 1] - scene.faces[face, 0]
    side = (walls - points[0]) @ (np.array([-along[1], along[0]]) / np.hypot(*along))
    walls, lookouts = walls[np.any(side > 1e-9, axis=1)], _in_front(lookouts, points[0], along)
    if not len(lookouts):
        return np.zeros(len(points), dtype=bool)
    base = np.arctan2(along[1], along[0])
    fan = base + np.arange(0.5 * FAN_RAD, np.pi, FAN_RAD)
    return np.array([_sees(point, base, fan, walls, lookouts, scene.range_m) for point in points])


def _sees(
    point: Float[np.ndarray, "2"],
    base: float,
    fan: Float[np.ndarray, " r"],
    walls: Float[np.ndarray, "n 2 2"],
    lookouts: Float[np.ndarray, "l 2 2"],
    range_m: float,
) -> bool:
    """Return whether some ray from a face point, bearings in (base, base + pi), meets the region before a wall."""
    # Most points see the region along one of a few rays; the whole fan is for the others.
    few = fan[::COARSE]
    if np.any(_reach(point, few, lookouts, range_m) < _reach(point, few, walls, np.inf)):
        return True
    depth = _reach(point, fan, walls, np.inf)
    if np.any(_reach(point, fan, lookouts, range_m) < depth):
        return True
    # A gap narrower than the fan's step lies between corners, so rays just beside each visible corner find it.
    corner = walls.reshape(-1, 2) - point
    bearing = (np.arctan2(corner[:, 1], corner[:, 0]) - base) % (2 * np.pi)
    slot = np.clip((bearing / FAN_RAD - 0.5).astype(int), 0, len(fan) - 2)
    in_sight = np.hypot(corner[:, 0], corner[:, 1]) <= 0.1 + 1.1 * np.maximum(depth[slot], depth[slot + 1])
    near = np.concatenate([bearing[in_sight] - BESIDE_RAD, bearing[in_sight] + BESIDE_RAD])
    near = base + near[(near > 0) & (near < np.pi)]
    return bool(np.any(_reach(point, near, lookouts, range_m) < _reach(point, near, walls, np.inf)))


def _in_front(
    edges: Float[np.ndarray, "n 2 2"], point: Float[np.ndarray, "2"], along: Float[np.ndarray, "2"]
) -> Float[np.ndarray, "m 2 2"]:
    side = (edges - point) @ np.array([-along[1], along[0]])
    return edges[np.any(side > 0, axis=1)]


def _reach(
    point: Float[np.ndarray, "2"], bearings: Float[np.ndarray, " r"], edges: Float[np.ndarray, "n 2 2"], limit_m: float
) -> Float[np.ndarray, " r"]:
    """Return the length of each ray from `point` to the first edge; infinite beyond `limit_m`."""
    ray_x, ray_y = np.cos(bearings)[:, None], np.sin(bearings)[:, None]
    (x, y), (along_x, along_y) = (edges[:, 0] - point).T, (edges[:, 1] - edges[:, 0]).T
    cross = ray_x * along_y - ray_y * along_x
    share = (x * ray_y - y * ray_x) / np.where(cross == 0, np.nan, cross)
    distance = (x * along_y - y * along_x) / np.where((share >= 0) & (share <= 1), cross, np.nan)
    distance = np.where((distance > 1e-9) & (distance <= limit_m), distance, np.inf)
    nearest: Float[np.ndarray, " r"] = np.min(distance, axis=1, initial=np.inf)
    return nearest


def _refine(
    scene: _Scene,
    face: Int[np.ndarray, " t"],
    low: Float[np.ndarray, " t"],
    high: Float[np.ndarray, " t"],
    low_seen: Bool[np.ndarray, " t"],
) -> Float[np.ndarray, " t"]:
    """Return where visibility begins or ends between two neighbouring points, by bisection."""
    for _ in range(HALVINGS):
        middle = 0.5 * (low + high)
        same = _seen(scene, face, middle) == low_seen
        low, high = np.where(same, middle, low), np.where(same, high, middle)
    turning: Float[np.ndarray, " t"] = 0.5 * (low + high)
    return turning


def _intervals(
    faces: Float[np.ndarray, "n 2 2"], face_rings: Int[np.ndarray, " n"], spans: list[Float[np.ndarray, "_ 2"]]
) -> Contour:
    face = np.repeat(np.arange(len(faces)), [len(span) for span in spans])
    span_m = np.concatenate(spans).reshape(-1, 2)
    lengths = np.hypot(*(faces[:, 1] - faces[:, 0]).T)
    along = ((faces[:, 1] - faces[:, 0]) / lengths[:, None])[face]
    segments = faces[face, :1] + span_m[:, :, None] * along[:, None, :]
    count = int(face_rings.max()) + 1
    seen = np.bincount(face_rings[face], weights=span_m[:, 1] - span_m[:, 0], minlength=count)
    whole = np.bincount(face_rings, weights=lengths, minlength=count)
    return Contour(face, span_m, segments, np.flatnonzero(seen >= np.minimum(0.1, 0.5 * whole)))
