"""Triangles of measured relations: from a to b and on to c against straight to c."""

from dataclasses import replace
from pathlib import Path

import numpy as np
from scipy.sparse import bsr_array

from chainslam.slam.evaluation.consistency import nees

from ....scoring.without_truth.references import read_relations
from ....scoring.without_truth.relation_noise import (
    Sigmas,
    adjoint_of_inverse,
    composed,
    sigmas_of_relations,
    triangles,
)
from ....scoring.without_truth.relations import between
from ....usage import UsageError
from ....views.numbers import number
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


def closures(path: Path, stated: tuple[float, float] | None) -> Inner:
    """Return how triangles of relations close, by their stated standard deviations (m, rad) or by estimated ones.

    Raises UsageError where too few triangles close.
    """
    relations = read_relations(path)
    rows = triangles(relations)
    estimated = sigmas_of_relations(relations)
    if len(rows) < LEAST or estimated is None:
        raise UsageError(
            f"expected at least {LEAST} triangles of relations in {path} (a to b, b to c and a to c), found"
            f" {len(rows)}: give a trajectory to compare them with"
        )
    sigmas = estimated if stated is None else Sigmas(*stated)
    ab, bc, ac = (relations.motions[column] for column in rows.T)
    back = adjoint_of_inverse(bc)
    left, covs = between(ac, composed(ab, bc)), 2.0 * sigmas.cov + back @ sigmas.cov @ back.swapaxes(1, 2)
    order = np.argsort(relations.first_s[rows[:, 0]], kind="stable")
    notes = () if stated is None else (f"estimated from the triangles it is {_told(estimated)}",)
    told = _with(_told(estimated)) if stated is None else JUDGED
    times = [f"{a:.2f}, {b:.2f} and {c:.2f} s" for a, b, c in zip(
        relations.first_s[rows[:, 0]], relations.second_s[rows[:, 0]], relations.second_s[rows[:, 1]], strict=True
    )]  # fmt: skip
    whiten = np.linalg.inv(np.linalg.cholesky(covs))
    return Inner(
        path.name, told, relations.first_s[rows[:, 0]][order], nees(left, covs)[order], np.full(len(rows), 3),
        tuple(times[row] for row in order), _dof(rows, back, whiten, np.sqrt(sigmas.cov), len(relations.motions)),
        notes, is_judged=stated is not None,
    )  # fmt: skip


def _told(sigmas: Sigmas) -> str:
    return f"{number(sigmas.translation_m)} m and {number(sigmas.rotation_rad)} rad"


def _with(sigmas: str) -> Told:
    return replace(ESTIMATED, subject=ESTIMATED.subject.format(sigmas=sigmas))


def _dof(rows: np.ndarray, back: np.ndarray, whiten: np.ndarray, root: np.ndarray, count: int) -> float:
    """Return the degrees of freedom of the sum of all squares: triangles that share a relation are correlated."""
    t = len(rows)
    of = np.stack([whiten @ back @ root, whiten @ root, -whiten @ root], axis=1).reshape(-1, 3, 3)
    B = bsr_array((of, rows.ravel(), 3 * np.arange(t + 1)), shape=(3 * t, 3 * count)).tocsr()
    K = B.T @ B if count < t else B @ B.T
    return (3.0 * t) ** 2 / float(K.power(2).sum())
