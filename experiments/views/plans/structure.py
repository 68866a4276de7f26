"""Right angles, parallels, collinear walls and walls of equal thickness: how probable each is, and the map with them.

Directions modulo 90 degrees, places across a direction, and thicknesses are values of which some are equal. What is
surely equal may be imposed on the joint estimate of all walls; the map itself is not changed.
"""

from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass, replace
from enum import StrEnum
from pathlib import Path

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.estimation.backend import POSE
from chainslam.slam.geometry.lines import directions, normals

from ...scoring.maps.equal_values import Classes, Scale, classes, imposed
from ...usage import UsageError
from .faces import Faces, read_faces, read_solid
from .measuring import Kind, apart
from .sight import Pair, facing
from .survey import FACES_OVERLAP_M, LONG_M, THICKEST_M, Survey, survey

QUARTER = 0.5 * np.pi
DIRECTIONS = Scale(
    tuple(np.deg2rad([0.01, 0.02, 0.05, 0.1]).tolist()), tuple(np.deg2rad([0.5, 1.0, 2.0, 4.0, 8.0]).tolist()),
    QUARTER, is_periodic=True,
)  # fmt: skip
"""Drawn walls are square to 0.01 degrees, built ones to 0.1: DIN 18202 allows 8 mm on 3 m, which is 0.15 degrees. In
drawings of schools, what is not square is so by 0.5 to 15 degrees."""
PLACES_M = (0.0005, 0.001, 0.002, 0.005)
STEPS_M = (0.01, 0.02, 0.04, 0.08, 0.16)
"""Walls that are nearly collinear, or nearly as thick, differ by so much: a skirting, a pilaster, a layer of bricks."""
THICKNESSES = Scale(PLACES_M, STEPS_M, THICKEST_M)
MOST_DEG = 0.5
"""A larger tolerance would take walls for square that are askew."""
TOLD = 0.05
"""Relations that are less probable are not told."""


class Relation(StrEnum):
    """What two walls have in common."""

    PARALLEL = "parallel"
    RIGHT_ANGLE = "right angle"
    COLLINEAR = "collinear"
    THICKNESS = "equal thickness"


@dataclass(frozen=True)
class Hypothesis:
    """A relation of walls, with its probability."""

    relation: Relation
    walls: tuple[int, ...]
    """Rows: a wall and the longest one of its class; of two thicknesses the faces of both walls."""
    probability: float
    is_used: bool


@dataclass(frozen=True)
class Structure:
    """A map with all relations that are sure."""

    faces: Faces
    hypotheses: tuple[Hypothesis, ...]
    square: Bool[np.ndarray, " n"] | None
    """Which walls surely have the main direction or are square to it; None if none do."""
    tolerance_rad: float
    """Standard deviation of the directions of walls about the main one that they are parallel or square to."""

    @property
    def words(self) -> str:
        """How many relations were imposed, by what they are."""
        counts = Counter(each.relation for each in self.hypotheses if each.is_used)
        told = ", ".join(f"{count} {relation}" for relation, count in counts.items()) or "none"
        return f"sure relations: {told}; tolerance of directions {np.rad2deg(self.tolerance_rad):.3f} degrees"


def structure_of(faces: Faces, tolerance_rad: float | None = None) -> Structure:
    """Return a map with its sure relations imposed; without a tolerance it is estimated from the map."""
    alpha = faces.means[:, 0]
    H = np.zeros((len(faces), POSE + 2 * len(faces)))
    H[np.arange(len(faces)), POSE + 2 * np.arange(len(faces))] = 1.0
    turned = classes(alpha, H @ faces.cov @ H.T, DIRECTIONS, tolerance_rad)
    longest = _longest(turned, faces.lengths_m)
    quarters = np.array([
        np.rint((alpha[row] - alpha[longest[k]]) / QUARTER) if k >= 0 else 0.0
        for row, k in enumerate(turned.nearest.tolist())
    ])  # fmt: skip
    by_turn = (Relation.PARALLEL, Relation.RIGHT_ANGLE)
    found = [
        Hypothesis(by_turn[int(quarters[row]) % 2], (row, first), *told) for row, first, told in _told(turned, longest)
    ]
    result, collinear = _collinear(_with(faces, alpha - QUARTER * quarters, H, turned), turned, quarters)
    result, thick = _thick(result)
    likely = [each for each in (*found, *collinear, *thick) if each.probability >= TOLD]
    order = list(Relation)
    likely.sort(key=lambda each: (order.index(each.relation), -each.probability))
    kept = {k: turned.of == k for k in longest if (turned.of == k).any()}
    square = max(kept.values(), key=lambda rows: float(faces.lengths_m[rows].sum()), default=None)
    return Structure(result, tuple(likely), square, turned.tolerance)


def structured_at(folder: Path, tolerance_deg: float | None = None) -> tuple[Structure, Survey]:
    """Measure the map in the folder of a run or of a replayed log with its sure relations imposed; raises UsageError
    for anything else.
    """
    if tolerance_deg is not None and not 0.0 < tolerance_deg <= MOST_DEG:
        raise UsageError(
            f"expected a tolerance above 0 and up to {MOST_DEG:g} degrees, found {tolerance_deg:g}: correct it"
        )
    structure = structure_of(read_faces(folder), None if tolerance_deg is None else float(np.deg2rad(tolerance_deg)))
    return structure, replace(survey(structure.faces, read_solid(folder)), square=structure.square)


def needs_structure(is_asked: bool, tolerance_deg: float | None) -> None:
    """Raise UsageError for a tolerance without structure."""
    if tolerance_deg is not None and not is_asked:
        raise UsageError("expected --structure with --tolerance-deg, found the tolerance alone: add --structure")


def _longest(found: Classes, sizes: Float[np.ndarray, " n"]) -> dict[int, int]:
    """Return the value of each class that the others are compared with: of the sure ones, where there are any."""
    rows = {}
    for k in np.unique(found.nearest[found.nearest >= 0]).tolist():
        among = (found.of if (found.of == k).any() else found.nearest) == k
        rows[int(k)] = int(np.where(among, sizes, -1.0).argmax())
    return rows


def _told(found: Classes, longest: dict[int, int]) -> list[tuple[int, int, tuple[float, bool]]]:
    """Return each value with the one that it is compared with, the probability that they are equal, and whether that
    is sure.
    """
    return [
        (row, longest[k], (float(found.probability[row]), bool(found.of[row] >= 0)))
        for row, k in enumerate(found.nearest.tolist()) if k >= 0 and row != longest[k]
    ]  # fmt: skip


def _with(
    faces: Faces, values: Float[np.ndarray, " n"], H: Float[np.ndarray, "n s"], found: Classes,
    lean: Float[np.ndarray, "n n"] | float = 0.0,
) -> Faces:  # fmt: skip
    if not (found.of >= 0).any():
        return faces
    noise = found.tolerance**2 * np.eye(len(values)) + lean
    correction, cov = imposed(values, H, faces.cov, found.of, noise)
    means = faces.means + correction[POSE:].reshape(-1, 2)
    return replace(faces, means=means, cov=cov, pose_world=faces.pose_world + correction[:POSE])


def _collinear(faces: Faces, turned: Classes, quarters: Float[np.ndarray, " n"]) -> tuple[Faces, list[Hypothesis]]:
    """Impose that walls of one direction and one side, some metres apart along it, are on one line.

    The line itself leans by as much as the directions of walls may.
    """
    found: list[Hypothesis] = []
    for k, quarter in sorted({(int(k), int(q) % 4) for k, q in zip(turned.of, quarters, strict=True) if k >= 0}):
        rows = np.flatnonzero((turned.of == k) & (quarters % 4 == quarter))
        if len(rows) < 2:
            continue
        places, arms, H = _places(faces, rows)
        lean = turned.tolerance**2 * np.outer(arms, arms)
        scale = Scale(PLACES_M, STEPS_M, max(float(np.ptp(places)), 1.0))
        equal = classes(places, H @ faces.cov @ H.T + lean, scale)
        found += [
            Hypothesis(Relation.COLLINEAR, (int(rows[j]), int(rows[first])), *told)
            for j, first, told in _told(equal, _longest(equal, faces.lengths_m[rows]))
        ]
        faces = _with(faces, places, H, equal, lean)
    return faces, found


def _places(
    faces: Faces, rows: Int[np.ndarray, " m"]
) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"], Float[np.ndarray, "m s"]]:
    """Return where the middles of parallel walls are across their mean direction and along it, from the mean of all,
    and the derivative of the former by the state.
    """
    alpha, d = faces.means[rows].T
    turn = np.angle(np.mean(np.exp(1j * alpha)))
    along = faces.extents[rows].mean(axis=1)
    middles = faces.anchors[rows] + d[:, None] * normals(alpha) + along[:, None] * directions(alpha)
    middles -= middles.mean(axis=0)
    n, arms = normals(turn), middles @ directions(turn)
    H = np.zeros((len(rows), POSE + 2 * len(faces)))
    H[:, POSE + 2 * rows] = arms[:, None] / len(rows)
    mine = np.arange(len(rows))
    H[mine, POSE + 2 * rows] += (d[:, None] * directions(alpha) - along[:, None] * normals(alpha)) @ n
    H[mine, POSE + 2 * rows + 1] = normals(alpha) @ n
    return middles @ n, arms, H


def _thick(faces: Faces) -> tuple[Faces, list[Hypothesis]]:
    """Impose that walls are equally thick."""
    backs: Sequence[Pair] = facing(faces, LONG_M, THICKEST_M, FACES_OVERLAP_M, behind=True)
    if len(backs) < 2:
        return faces, []
    told = [apart(faces, Kind.THICKNESS, each.first, each.second, each.at_world) for each in backs]
    values, H = np.array([value for value, _ in told]), np.stack([gradient for _, gradient in told])
    equal = classes(values, H @ faces.cov @ H.T, THICKNESSES)
    walls = [(each.first, each.second) for each in backs]
    longest = _longest(equal, np.array([each.overlap_m for each in backs]))
    found = [
        Hypothesis(Relation.THICKNESS, (*walls[j], *walls[first]), *told) for j, first, told in _told(equal, longest)
    ]
    return _with(faces, values, H, equal), found
