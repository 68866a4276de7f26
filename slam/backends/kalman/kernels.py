"""Parts of a covariance of which the lower triangle holds: the loops of `dense_map`."""

import numpy as np
from jaxtyping import Float, Int

from ...geometry.compiled import compiled


@compiled
def across(P: Float[np.ndarray, "t t"], rows: Int[np.ndarray, " r"]) -> Float[np.ndarray, "r t"]:
    """Return whole rows of P."""
    found = np.empty((len(rows), len(P)))
    for k in range(len(rows)):
        row = rows[k]
        for j in range(len(P)):
            found[k, j] = P[row, j] if row >= j else P[j, row]
    return found


@compiled
def block(P: Float[np.ndarray, "t t"], rows: Int[np.ndarray, " r"]) -> Float[np.ndarray, "r r"]:
    """Return the part of P of some rows, and the columns of the same numbers."""
    found = np.empty((len(rows), len(rows)))
    for k in range(len(rows)):
        for j in range(len(rows)):
            found[k, j] = P[max(rows[k], rows[j]), min(rows[k], rows[j])]
    return found
