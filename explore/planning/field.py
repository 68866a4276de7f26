"""How far it is to drive to one place from everywhere around the way there."""

from typing import NamedTuple

import numpy as np
from jaxtyping import Float

OUTWARDS_CELLS, OUTWARDS_COST = 3, 8.0
"""So far beyond where the body fits the field goes on, at so much a metre: the robot may stand there, and gets away.

Two walls leave more cells between them in which it does not fit."""


class Field(NamedTuple):
    """What is left of the way, by place and, for a body with an outline, by heading."""

    metres: Float[np.ndarray, "h w k"]
    """Infinite where no way leads."""
    corner_world: Float[np.ndarray, "2"]
    """Where the first cell begins."""
    cell_m: float
    headings_rad: Float[np.ndarray, " k"]
    """From -pi on, ascending; a single one for a disc."""


def outwards(metres: Float[np.ndarray, "h w k"], cell_m: float) -> Float[np.ndarray, "h w k"]:
    """Return a field that goes on a few cells beyond where a way leads."""
    metres = np.where(np.isfinite(metres), metres, np.inf)
    for _ in range(OUTWARDS_CELLS):
        padded = np.pad(metres, ((1, 1), (1, 1), (0, 0)), constant_values=np.inf)
        beside = np.minimum.reduce([padded[:-2, 1:-1], padded[2:, 1:-1], padded[1:-1, :-2], padded[1:-1, 2:]])
        metres = np.where(np.isfinite(metres), metres, beside + OUTWARDS_COST * cell_m)
    return metres
