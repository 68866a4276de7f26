"""Which wall of the map each segment of a scan belongs to (paper, section 2.1)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Int


@dataclass(frozen=True)
class Matches:
    """Pairs of segment and wall."""

    pairs: Int[np.ndarray, "m 2"]
    """Rows (index of the segment, id of the wall)."""
    unmatched: Int[np.ndarray, " u"]
    """Indices of the segments that belong to no wall."""
    refusals: dict[int, str]
    """For each unmatched segment, why its nearest wall was refused."""
