"""Small dense matrices in compiled loops: roots of covariances, and what follows from them."""

import math

import numpy as np
from jaxtyping import Float

from .compiled import compiled


@compiled
def wrapped(angle: float) -> float:
    """Return an angle rad brought into [-pi, pi)."""
    return (angle + math.pi) % (2.0 * math.pi) - math.pi


@compiled
def whitening(S: Float[np.ndarray, "k k"]) -> Float[np.ndarray, "k k"]:
    """Return W, lower triangular, with W S W' = I and W' W the inverse of S: that of its Cholesky root."""
    k = len(S)
    L, W = np.zeros((k, k)), np.zeros((k, k))
    for i in range(k):
        for j in range(i + 1):
            rest = S[i, j]
            for c in range(j):
                rest -= L[i, c] * L[j, c]
            L[i, j] = math.sqrt(rest) if i == j else rest / L[j, j]
        W[i, i] = 1.0 / L[i, i]
        for j in range(i):
            rest = 0.0
            for c in range(j, i):
                rest -= L[i, c] * W[c, j]
            W[i, j] = rest * W[i, i]
    return W


@compiled
def gain_of(PHt: Float[np.ndarray, "s k"], W: Float[np.ndarray, "k k"]) -> Float[np.ndarray, "s k"]:
    """Return P H' S^-1, given W of S."""
    s, k = PHt.shape
    gain, white = np.zeros((s, k)), np.empty(k)
    for row in range(s):
        for i in range(k):
            white[i] = 0.0
            for c in range(i + 1):
                white[i] += W[i, c] * PHt[row, c]
        for i in range(k):
            for c in range(i + 1):
                gain[row, c] += W[i, c] * white[i]
    return gain


@compiled
def squared_distance(e0: float, e1: float, s00: float, s01: float, s11: float) -> float:
    """Return the squared Mahalanobis distance of a two-vector."""
    return (s11 * e0 * e0 - 2.0 * s01 * e0 * e1 + s00 * e1 * e1) / (s00 * s11 - s01 * s01)
