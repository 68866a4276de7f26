"""Triangles of measured relations: from a to b and on to c against straight to c."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.sparse import bsr_array

from chainslam.slam.evaluation.consistency import nees

from ....scoring.without_truth.references import read_relations
from ....scoring.without_truth.relation_noise import Sigmas
from ....usage import UsageError
from ....views.numbers import number
from ..geometry.kinds import misclosures
from ..reading.stated import Space
from .inner import Inner, Told

LEAST = 10
"""Triangles that an audit needs."""
JUDGED = Told(
    "stated sigma of the relations",
    "triangles",
    "NEES per degree of freedom",
    "whether relations close triangles as closely as their stated sigma says",
    "an error that cancels around each triangle; and nothing of any trajectory, so the pose itself cannot be judged",
    "time of the first pose (s)",
)
ESTIMATED = Told(
    "sigma {sigmas}, estimated from their triangles",
    "triangles",
    "NEES per degree of freedom",
    "how large the error of a relation is, and which triangles do not close within it",
    "whether a stated sigma is right, unless --reference-sigma states one; and nothing of any trajectory, so the pose"
    " itself cannot be judged",
    "time of the first pose (s)",
)


def closures(path: Path, stated: tuple[float, float] | None, space: Space = "plane") -> Inner:
    """Return how triangles of relations close, by their stated standard deviations (m, rad) or by estimated ones.

    Raises UsageError where too few triangles close.
    """
    relations = read_relations(path, space == "space")
    found = misclosures(relations)
    rows, d, estimated = found.rows, found.left.shape[1], found.sigmas
    if len(rows) < LEAST or estimated is None:
        raise UsageError(
            f"expected at least {LEAST} triangles of relations in {path} (a to b, b to c and a to c), found"
            f" {len(rows)}: give a trajectory to compare them with"
        )
    sigmas = estimated if stated is None else Sigmas(*stated)
    own = sigmas.cov_of(d)
    covs = found.covs(own)
    order = np.argsort(relations.first_s[rows[:, 0]], kind="stable")
    notes = () if stated is None else (f"estimated from the triangles it is {_told(estimated)}",)
    told = _with(_told(estimated)) if stated is None else JUDGED
    times = [f"{a:.2f}, {b:.2f} and {c:.2f} s" for a, b, c in zip(
        relations.first_s[rows[:, 0]], relations.second_s[rows[:, 0]], relations.second_s[rows[:, 1]], strict=True
    )]  # fmt: skip
    whiten = np.linalg.inv(np.linalg.cholesky(covs))
    return Inner(
        path.name, told, relations.first_s[rows[:, 0]][order], nees(found.left, covs)[order], np.full(len(rows), d),
        tuple(times[row] for row in order), _dof(rows, found.back, whiten, np.sqrt(own), len(relations.motions)),
        notes, is_judged=stated is not None,
    )  # fmt: skip


def _told(sigmas: Sigmas) -> str:
    return f"{number(sigmas.translation_m)} m and {number(sigmas.rotation_rad)} rad"


def _with(sigmas: str) -> Told:
    return replace(ESTIMATED, subject=ESTIMATED.subject.format(sigmas=sigmas))


def _dof(rows: np.ndarray, back: np.ndarray, whiten: np.ndarray, root: np.ndarray, count: int) -> float:
    """Return the degrees of freedom of the sum of all squares: triangles that share a relation are correlated."""
    t, d = len(rows), len(root)
    of = np.stack([whiten @ back @ root, whiten @ root, -whiten @ root], axis=1).reshape(-1, d, d)
    B = bsr_array((of, rows.ravel(), 3 * np.arange(t + 1)), shape=(d * t, d * count)).tocsr()
    K = B.T @ B if count < t else B @ B.T
    return (d * t) ** 2 / float(K.power(2).sum())
