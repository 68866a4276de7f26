"""What the innovations of a scan say of the noise of the last motion: the loops of `motion_noise`."""

import math

import numpy as np
from jaxtyping import Float

from ...geometry.compiled import compiled

SINGULAR = 1e-12
"""A part of a motion's variance below this share of it is rounding: the motion has no noise of its own there."""


@compiled
def motion_root(cov: Float[np.ndarray, "3 3"], turn_rad: float) -> Float[np.ndarray, "3 3"]:
    """Return G with G G' a covariance of (x, y, heading), which may be singular, turned by an angle."""
    L = np.zeros((3, 3))
    for j in range(3):
        pivot = cov[j, j]
        for c in range(j):
            pivot -= L[j, c] * L[j, c]
        if pivot <= SINGULAR * cov[j, j]:
            continue
        L[j, j] = math.sqrt(pivot)
        for i in range(j + 1, 3):
            rest = cov[i, j]
            for c in range(j):
                rest -= L[i, c] * L[j, c]
            L[i, j] = rest / L[j, j]
    cosine, sine = math.cos(turn_rad), math.sin(turn_rad)
    for j in range(3):
        x, y = L[0, j], L[1, j]
        L[0, j], L[1, j] = cosine * x - sine * y, sine * x + cosine * y
    return L


@compiled
def surprise(
    e: Float[np.ndarray, " k"],
    H_pose: Float[np.ndarray, "k 3"],
    W: Float[np.ndarray, "k k"],
    G: Float[np.ndarray, "3 3"],
) -> tuple[float, Float[np.ndarray, "3"], Float[np.ndarray, "3"]]:
    """Return e' S^-1 e, and along the axes of A = G' H' S^-1 H G its eigenvalues a and w = G' H' S^-1 e.

    W whitens e: W S W' = I.
    """
    k = len(e)
    squared, A, told = 0.0, np.zeros((3, 3)), np.zeros(3)
    white = np.empty(3)
    for row in range(k):
        along = 0.0
        white[:] = 0.0
        for c in range(row + 1):
            along += W[row, c] * e[c]
            for i in range(3):
                white[i] += W[row, c] * H_pose[c, i]
        squared += along * along
        moved = np.zeros(3)
        for i in range(3):
            for j in range(3):
                moved[j] += white[i] * G[i, j]
        for i in range(3):
            told[i] += moved[i] * along
            for j in range(3):
                A[i, j] += moved[i] * moved[j]
    a, axes = np.linalg.eigh(A)
    w = np.zeros(3)
    for i in range(3):
        a[i] = min(max(a[i], 0.0), 1.0)
        for j in range(3):
            w[i] += axes[j, i] * told[j]
    return squared, a, w


@compiled
def gains(
    a: Float[np.ndarray, "3"], w: Float[np.ndarray, "3"], factors: Float[np.ndarray, " f"]
) -> Float[np.ndarray, " f"]:
    """Return by how much each factor of the noise raises the log-likelihood of one scan."""
    gained = np.zeros(len(factors))
    for k in range(len(factors)):
        c = factors[k] * factors[k] - 1.0
        for i in range(3):
            gained[k] += 0.5 * (c * w[i] * w[i] / (1.0 + c * a[i]) - math.log1p(c * a[i]))
    return gained
