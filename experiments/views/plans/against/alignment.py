"""A map laid over a drawing: which wall is which face, and the rigid motion between the two."""

from dataclasses import dataclass
from itertools import product

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int
from shapely.geometry.base import BaseGeometry

from chainslam.slam.geometry.lines import directions, normals, through
from chainslam.slam.geometry.poses import to_robot, to_world, wrap

from ....usage import UsageError
from ..faces import Faces
from ..measuring import commonest, main_direction

SHORT_M = 0.3
"""Shorter walls and faces are not compared: their direction is not known well enough to tell which is which."""
NEAR_M = 0.3
"""A wall that is farther from a face is another one."""
NEAR_RAD = float(np.deg2rad(5.0))
OVERLAP_M = 0.2
SAMPLE_M = 0.2
ENOUGH = 0.6
"""Share of the walls that have to lie on faces."""
RIVAL, APART_M, APART_RAD = 0.95, 0.5, float(np.deg2rad(45.0))
"""Another alignment, so far away, must not fit as well as this share of the best."""
PEAKS = 12
ROUNDS = 8
BEHIND_M = 0.05
"""Where a wall is, its face hides what is so far behind."""


@dataclass(frozen=True)
class Sighting:
    """A wall of the map on a face of the drawing."""

    wall: int
    """Row in the map."""
    face: int
    """Row among the faces."""
    at_map: Float[np.ndarray, "2 2"]
    """The points of the wall at both ends of what both have in common, m, in the frame of the map."""
    span_m: tuple[float, float]
    """From and to along the face, m from its first end."""


def look(faces: Faces, design: Float[np.ndarray, "f 2 2"], pose: Float[np.ndarray, "3"]) -> list[Sighting]:
    """Return which walls lie on which faces; `pose` is that of the map's frame in the drawing."""
    ends = to_world(faces.ends_world.reshape(-1, 2), pose).reshape(-1, 2, 2)
    alpha, lines = faces.means[:, 0] + pose[2], through(design)
    lengths = np.hypot(*(design[:, 1] - design[:, 0]).T)
    found = []
    for wall in np.flatnonzero(faces.lengths_m >= SHORT_M).tolist():
        t = directions(lines[:, 0])
        span = np.vecdot(ends[wall][None] - design[:, :1], t[:, None])
        low, high = np.maximum(span.min(axis=1), 0.0), np.minimum(span.max(axis=1), lengths)
        middle = design[:, 0] + 0.5 * (low + high)[:, None] * t
        off = (ends[wall, 0] - middle) @ normals(alpha[wall]) / np.cos(alpha[wall] - lines[:, 0])
        good = (
            (np.abs(wrap(alpha[wall] - lines[:, 0])) <= NEAR_RAD) & (high - low >= OVERLAP_M) & (np.abs(off) <= NEAR_M)
        )
        good &= lengths >= SHORT_M
        if not good.any():
            continue
        # Of two faces one behind the other, as of a step, the nearer one; along one line it may be several.
        nearest = np.abs(off[good]).min()
        for face in np.flatnonzero(good & (np.abs(off) <= nearest + 0.05)).tolist():
            ends_of = design[face, 0] + np.array([[low[face]], [high[face]]]) * t[face]
            n, own = normals(lines[face, 0]), normals(alpha[wall])
            points = ends_of + (((ends[wall, 0] - ends_of) @ own) / (n @ own))[:, None] * n
            found.append(Sighting(wall, face, to_robot(points, pose), (float(low[face]), float(high[face]))))
    return found


def offsets(
    sightings: list[Sighting], design: Float[np.ndarray, "f 2 2"], pose: Float[np.ndarray, "3"]
) -> tuple[Float[np.ndarray, " e"], Float[np.ndarray, "e 3"]]:
    """Return how far (m) each wall is behind its face, and the derivative by the pose of the map in the drawing.

    Two rows for each sighting, one for each end of what both have in common.
    """
    points = np.array([each.at_map for each in sightings]).reshape(-1, 2)
    lines = through(design[[each.face for each in sightings for _ in range(2)]])
    n, turned = normals(lines[:, 0]), to_world(points, np.array([0.0, 0.0, pose[2]]))
    off = np.vecdot(n, turned + pose[:2]) - lines[:, 1]
    return off, np.column_stack([n, np.vecdot(n, np.stack([-turned[:, 1], turned[:, 0]], axis=-1))])


def align(
    faces: Faces, design: Float[np.ndarray, "f 2 2"], guess: Float[np.ndarray, "3"] | None
) -> Float[np.ndarray, "3"]:
    """Return the pose of the map's frame in the drawing, by its walls; from a guess, or from anywhere.

    Raises UsageError where too little fits, or where two alignments fit about as well.
    """
    if guess is not None and (fine := refined(faces, design, guess)) is not None and fit(faces, design, fine) >= ENOUGH:
        return fine
    ranked = sorted(((fit(faces, design, pose), tuple(pose)) for pose in _candidates(faces, design)), reverse=True)
    best = next(
        (fine for _, pose in ranked[:PEAKS] if (fine := refined(faces, design, np.array(pose))) is not None), None
    )
    score = 0.0 if best is None else fit(faces, design, best)
    if best is None or score < ENOUGH:
        raise UsageError(
            f"expected a map of the building that is drawn, found {100 * score:.0f} % of its walls on those of the"
            f" drawing where it fits best ({100 * ENOUGH:.0f} % needed): name the building's own drawing, or give --at"
        )
    for other, pose in ranked:
        far = np.hypot(pose[0] - best[0], pose[1] - best[1]) > APART_M or abs(wrap(pose[2] - best[2])) > APART_RAD
        if far and other >= RIVAL * score:
            raise UsageError(
                f"expected one place of the map in the drawing, found two that fit about as well ({best[0]:.2f}"
                f" {best[1]:.2f} {np.rad2deg(best[2]):.0f} and {pose[0]:.2f} {pose[1]:.2f} {np.rad2deg(pose[2]):.0f}):"
                " choose one by --at X Y DEGREES"
            )
    return best


def refined(
    faces: Faces, design: Float[np.ndarray, "f 2 2"], pose: Float[np.ndarray, "3"]
) -> Float[np.ndarray, "3"] | None:
    """Return a pose moved so that the walls lie on their faces, by least absolute offsets; None where nothing does."""
    for _ in range(ROUNDS):
        sightings = look(faces, design, pose)
        if len(sightings) < 3:
            return None
        off, by_pose = offsets(sightings, design, pose)
        weight = np.repeat([high - low for low, high in (each.span_m for each in sightings)], 2) / np.maximum(
            np.abs(off), 0.005
        )
        normal = by_pose.T @ (weight[:, None] * by_pose)
        if np.linalg.cond(normal) > 1e10:
            return None
        pose = pose - np.linalg.solve(normal, by_pose.T @ (weight * off))
    return np.array([*pose[:2], wrap(pose[2])])


def fit(faces: Faces, design: Float[np.ndarray, "f 2 2"], pose: Float[np.ndarray, "3"]) -> float:
    """Return which share of the walls' length lies on faces that look the same way."""
    points, alpha, _ = _samples(faces)
    on = _on(to_world(points, pose), alpha + pose[2], design)
    return float(on.mean()) if len(on) else 0.0


def off_design(faces: Faces, design: Float[np.ndarray, "f 2 2"], pose: Float[np.ndarray, "3"]) -> list[int]:
    """Return the rows of walls of which most lies on no face."""
    points, alpha, row = _samples(faces)
    on = _on(to_world(points, pose), alpha + pose[2], design)
    return [int(wall) for wall in np.unique(row) if on[row == wall].mean() < 0.5]


def saw_through(
    solid: BaseGeometry, design: Float[np.ndarray, "f 2 2"], pose: Float[np.ndarray, "3"]
) -> Bool[np.ndarray, " f"]:
    """Return behind which faces most is floor that the robot saw; `solid` is all else, in the frame of the map."""
    share = np.linspace(0.1, 0.9, 9)[:, None, None]
    behind = design[:, 0] + share * (design[:, 1] - design[:, 0]) + BEHIND_M * normals(through(design)[:, 0])
    points = to_robot(behind.reshape(-1, 2), pose)
    shapely.prepare(solid)
    return np.asarray(~shapely.contains_xy(solid, *points.T).reshape(9, -1)).mean(axis=0) > 0.5


def _samples(faces: Faces) -> tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, " m"], Int[np.ndarray, " m"]]:
    walls = np.flatnonzero(faces.lengths_m >= SHORT_M)
    counts = np.maximum((faces.lengths_m[walls] / SAMPLE_M).astype(int), 1)
    row = np.repeat(walls, counts)
    share = np.concatenate([(np.arange(count) + 0.5) / count for count in counts]) if len(walls) else np.zeros(0)
    ends = faces.ends_world[row]
    return ends[:, 0] + share[:, None] * (ends[:, 1] - ends[:, 0]), faces.means[row, 0], row


def _on(
    points: Float[np.ndarray, "m 2"], alpha: Float[np.ndarray, " m"], design: Float[np.ndarray, "f 2 2"]
) -> Bool[np.ndarray, " m"]:
    lines, lengths = through(design), np.hypot(*(design[:, 1] - design[:, 0]).T)
    along = np.einsum("mfk,fk->mf", points[:, None] - design[None, :, 0], directions(lines[:, 0]))
    off = np.abs(points @ normals(lines[:, 0]).T - lines[:, 1])
    same = np.cos(alpha[:, None] - lines[None, :, 0]) > np.cos(2.0 * NEAR_RAD)
    return np.any(same & (off <= 0.5 * NEAR_M) & (along >= -0.1) & (along <= lengths + 0.1), axis=1)


def _candidates(faces: Faces, design: Float[np.ndarray, "f 2 2"]) -> list[Float[np.ndarray, "3"]]:
    """Return poses at which many walls lie on faces: four turns, and shifts by vote along both main directions."""
    lines, lengths = through(design), np.hypot(*(design[:, 1] - design[:, 0]).T)
    phi, _ = commonest(lines[:, 0], lengths)
    found = []
    for quarter in range(4):
        turn = phi - main_direction(faces).value + 0.5 * np.pi * quarter
        alpha, at = faces.means[:, 0] + turn, to_world(faces.ends_world.mean(axis=1), np.array([0.0, 0.0, turn]))
        shifts = []
        for axis in (phi, phi + 0.5 * np.pi):
            n = normals(np.array(axis))
            wall, face = np.nonzero(
                (np.abs(np.cos(alpha - axis)) > np.cos(NEAR_RAD))[:, None]
                & (np.cos(alpha[:, None] - lines[None, :, 0]) > np.cos(NEAR_RAD))
            )
            votes = (design.mean(axis=1) @ n)[face] - (at @ n)[wall]
            shifts.append([peak * n for peak in _peaks(votes, np.minimum(faces.lengths_m[wall], lengths[face]))])
        found += [np.array([*(one + other), turn]) for one, other in product(*shifts)]
    return found


def _peaks(votes: Float[np.ndarray, " v"], weights: Float[np.ndarray, " v"]) -> list[float]:
    cells: Int[np.ndarray, " v"] = np.round(votes / 0.1).astype(np.int64)
    if not len(cells):
        return []
    _, inverse = np.unique(cells, return_inverse=True)
    score = np.bincount(inverse, weights)
    best = np.argsort(-score, kind="stable")[:PEAKS]
    return [float(np.average(votes[inverse == k], weights=weights[inverse == k])) for k in best]
