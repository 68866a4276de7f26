"""As built against as designed: how far each face of a drawing was built from where it is drawn.

Offsets y of walls from their faces are B theta + S s + e: the alignment theta, which nobody knows, the shift s of each
face, and errors e of the map's joint covariance. Which faces were moved is searched for one by one (data snooping, as
in geodesy), each test at a level that holds for all of them together (Holm).
"""

from dataclasses import dataclass
from enum import StrEnum
from statistics import NormalDist

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.estimation.backend import POSE
from chainslam.slam.geometry.lines import directions
from chainslam.slam.geometry.numerics import TINY

from ....scoring.maps.measurements import Measured
from ....usage import UsageError
from ..faces import Faces
from .alignment import SHORT_M, Sighting, look, off_design, offsets

FLOOR_M = 0.2e-3
"""What lines of the map err by besides their noise."""
PIECE_M = 5e-3
"""The same, of a line that lies on several faces: the mapper makes one line of walls that are offset by less than the
noise of a beam, so that each of them may be that far off it."""
NORMAL = NormalDist()
LEAST = 3
OUTSTANDING = 4.0
"""A face that is off by so many times the median stands out."""
COVERED = 0.2
"""A face of which less was mapped is judged by what was seen through it, or not at all."""


class Verdict(StrEnum):
    """What is said of a face of the drawing, or of a wall of the map."""

    WITHIN = "within"
    """Its interval lies within the tolerance."""
    UNCLEAR = "unclear"
    """Its interval reaches beyond the tolerance, without showing that the face does."""
    MOVED = "moved"
    """It is beyond the tolerance, at the stated rate of false alarms."""
    MISSING = "missing"
    """The robot saw floor where it is drawn."""
    UNSEEN = "not seen"
    EXTRA = "extra"
    """Mapped, and not drawn."""


@dataclass(frozen=True)
class Finding:
    """What is said of one face."""

    verdict: Verdict
    face: int
    """Row among the faces of the drawing; of an extra wall its row in the map."""
    walls: tuple[int, ...]
    """Rows of the walls that lie on it."""
    shift: Measured | None = None
    """How far it stands from where it is drawn, m, away from the floor that it bounds."""
    seen: float = 0.0
    """Share of its length that was mapped."""


@dataclass(frozen=True)
class Comparison:
    """All findings, and how the map lies in the drawing."""

    pose: Float[np.ndarray, "3"]
    """Of the map's frame in the drawing: x m, y m, rad."""
    pose_cov: Float[np.ndarray, "3 3"]
    findings: tuple[Finding, ...]
    """Of all faces that are long enough to be compared, in their order, and of extra walls."""
    tests: int
    """How many faces were tested: the level holds for all of them together."""


@dataclass(frozen=True)
class _Fit:
    """The linear model of the offsets."""

    y: Float[np.ndarray, " k"]
    B: Float[np.ndarray, "k 3"]
    S: Float[np.ndarray, "k m"]
    W: Float[np.ndarray, "k k"]
    """Inverse covariance of the offsets, with faces that are anywhere within the tolerance."""
    spread_m2: float
    """Variance of the shift of a face within the tolerance."""

    def without(self, moved: list[int]) -> Float[np.ndarray, "k k"]:
        """Return the weights of the offsets once the alignment and the shifts of moved faces are free."""
        D = np.column_stack([self.B, self.S[:, moved]])
        WD = self.W @ D
        return np.asarray(self.W - WD @ np.linalg.pinv(D.T @ WD, rcond=TINY, hermitian=True) @ WD.T)

    def shifts(self, moved: list[int]) -> tuple[Float[np.ndarray, " m"], Float[np.ndarray, " m"]]:
        """Return the shift of each face and its sigma, with the moved ones free; infinite where nothing tells it."""
        values, sigmas = np.zeros(self.S.shape[1]), np.full(self.S.shape[1], np.inf)
        shared = self.without(moved)
        for k in range(self.S.shape[1]):
            P = self.without([each for each in moved if each != k]) if k in moved else shared
            weight = float(self.S[:, k] @ P @ self.S[:, k])
            if weight > 1e-6 * float(self.S[:, k] @ self.W @ self.S[:, k]):
                values[k] = float(self.S[:, k] @ P @ self.y) / weight
                sigmas[k] = np.sqrt(max(1.0 / weight - self.spread_m2, FLOOR_M**2))
        return values, sigmas

    def chances(self, moved: list[int], tolerance_m: float) -> Float[np.ndarray, " m"]:
        """Return how likely an offset as large is of each face at the border of the tolerance."""
        return np.array([
            NORMAL.cdf((tolerance_m - abs(value)) / sigma) + NORMAL.cdf(-(tolerance_m + abs(value)) / sigma)
            for value, sigma in zip(*(each.tolist() for each in self.shifts(moved)), strict=True)
        ])  # fmt: skip


def compare(
    faces: Faces, design: Float[np.ndarray, "f 2 2"], pose: Float[np.ndarray, "3"], tolerance_m: float, level: float,
    is_free: Bool[np.ndarray, " f"],
) -> Comparison:  # fmt: skip
    """Compare a map, whose frame lies in the drawing at about `pose`, with the faces of the drawing.

    `is_free` says through which faces the robot saw. Short faces get no finding. Raises UsageError if nothing fits.
    """
    sightings = look(faces, design, pose)
    if len(sightings) < LEAST:
        raise UsageError(f"expected walls on {LEAST} faces of the drawing, found {len(sightings)}: give another --at")
    seen: Int[np.ndarray, " m"] = np.unique([each.face for each in sightings]).astype(np.int64)
    model = _model(faces, design, pose, sightings, seen, tolerance_m)
    moved = _moved(model, tolerance_m, level)
    values, sigmas = model.shifts(moved)
    D = np.column_stack([model.B, model.S[:, moved]])
    cov = np.linalg.pinv(D.T @ model.W @ D, rcond=TINY, hermitian=True)
    theta = -(cov @ D.T @ model.W @ model.y)[:3]
    findings = []
    for face in np.flatnonzero(np.hypot(*(design[:, 1] - design[:, 0]).T) >= SHORT_M).tolist():
        walls = tuple(dict.fromkeys(each.wall for each in sightings if each.face == face))
        share = _covered([each.span_m for each in sightings if each.face == face], design[face])
        at = int(np.searchsorted(seen, face))
        known = at < len(seen) and seen[at] == face and np.isfinite(sigmas[at])
        if not known or (share < COVERED and is_free[face]):
            findings.append(Finding(Verdict.MISSING if is_free[face] else Verdict.UNSEEN, face, walls, seen=share))
            continue
        shift = Measured(float(values[at]), float(sigmas[at]))
        within = max(map(abs, shift.interval)) <= tolerance_m
        verdict = Verdict.MOVED if at in moved else Verdict.WITHIN if within else Verdict.UNCLEAR
        findings.append(Finding(verdict, face, walls, shift, share))
    on = {each.wall for each in sightings}
    extra = [row for row in off_design(faces, design, pose + theta) if row not in on]
    findings += [Finding(Verdict.EXTRA, row, (row,)) for row in extra]
    return Comparison(pose + theta, cov[:3, :3], tuple(findings), len(seen))


def _model(
    faces: Faces, design: Float[np.ndarray, "f 2 2"], pose: Float[np.ndarray, "3"], sightings: list[Sighting],
    seen: Int[np.ndarray, " m"], tolerance_m: float,
) -> _Fit:  # fmt: skip
    y, B = offsets(sightings, design, pose)
    A = np.zeros((len(y), POSE + 2 * len(faces)))
    for k, each in enumerate(sightings):
        along = (each.at_map - faces.anchors[each.wall]) @ directions(faces.means[each.wall, 0])
        A[2 * k : 2 * k + 2, POSE + 2 * each.wall] = -along
        A[2 * k : 2 * k + 2, POSE + 2 * each.wall + 1] = 1.0
    S = np.repeat(np.array([each.face for each in sightings])[:, None] == seen, 2, axis=0).astype(np.float64)
    spread = tolerance_m**2 / 3.0
    pieces = np.bincount([each.wall for each in sightings])[[each.wall for each in sightings]]
    floor = np.diag(np.repeat(np.where(pieces > 1, PIECE_M, FLOOR_M), 2) ** 2)
    cov = A @ faces.cov @ A.T + floor + spread * S @ S.T
    return _Fit(y, B, S, np.linalg.inv(cov), spread)


def _moved(model: _Fit, tolerance_m: float, level: float) -> list[int]:
    """Return the faces that are beyond the tolerance, each tested with the shifts of the others free.

    Faces that were moved make others seem to be until they are found. So the search begins twice, with none of them and
    with all that stand out, and the explanation by fewer moved faces counts.
    """
    count = model.S.shape[1]
    first = np.abs(model.S.T @ model.y) / model.S.sum(axis=0)
    outstanding = max(OUTSTANDING * float(np.median(first)), tolerance_m, 2.0 * FLOOR_M) if count else 0.0
    begun = [int(k) for k in np.argsort(-first, kind="stable")[: count // 2] if first[k] > outstanding]
    return min((_settled(model, start, tolerance_m, level) for start in (begun, [])), key=len)


def _settled(model: _Fit, moved: list[int], tolerance_m: float, level: float) -> list[int]:
    """Take back the least sure face and add the surest one, until each of them is sure enough, and no other is."""
    count, moved = model.S.shape[1], list(moved)
    for _ in range(2):
        while moved:
            chances = model.chances(moved, tolerance_m)[moved]
            if chances.max() <= level / (count - len(moved) + 1):
                break
            moved.pop(int(chances.argmax()))
        while len(moved) < count // 2:
            chances = model.chances(moved, tolerance_m)
            chances[moved] = 1.0
            surest = int(np.argmin(chances))
            if chances[surest] > level / (count - len(moved)):
                break
            moved.append(surest)
    return moved


def _covered(spans: list[tuple[float, float]], face: Float[np.ndarray, "2 2"]) -> float:
    """Return which share of a face is covered by spans along it."""
    total, reached = 0.0, 0.0
    for low, high in sorted(spans):
        total += max(high - max(low, reached), 0.0)
        reached = max(reached, high)
    return min(total / max(float(np.hypot(*(face[1] - face[0]))), 1e-9), 1.0)
