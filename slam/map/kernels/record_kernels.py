"""Where walls stand in a table that is kept in ascending order of their ids."""

import numpy as np
from jaxtyping import Int

from ...geometry.compiled import compiled


@compiled
def rows_of(known: Int[np.ndarray, " m"], ids: Int[np.ndarray, " n"]) -> tuple[Int[np.ndarray, " n"], bool]:
    """Return where ids stand among those known, or would stand, -1 for -1 (none); and whether all are known."""
    rows, all_known = np.empty(len(ids), np.int64), True
    for k in range(len(ids)):
        if ids[k] < 0:
            rows[k] = -1
            continue
        low, high = 0, len(known)
        while low < high:
            middle = (low + high) // 2
            if known[middle] < ids[k]:
                low = middle + 1
            else:
                high = middle
        rows[k] = low
        all_known = all_known and low < len(known) and known[low] == ids[k]
    return rows, all_known
