"""Segments joined end to end: chains, their open ends, closed contours (paper, sections 2 and 2.2)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

TAIL, HEAD = 0, 1
"""The two ends of a wall: walking from tail to head, the free side is on the left."""


@dataclass(frozen=True)
class OpenEnd:
    """An end of a chain: the successor of this wall is still missing there."""

    wall: int
    """Id of the wall."""
    side: int
    """`TAIL` or `HEAD`."""
    position_world: Float[np.ndarray, "2"]
    """Where the wall stops, m."""


@dataclass(frozen=True)
class Chain:
    """Walls joined head to tail."""

    walls: tuple[int, ...]
    """Ids in order, free side on the left."""
    corners_world: Float[np.ndarray, "c 2"]
    """Where neighbours meet, in order, m; for a closed chain the last one joins the last wall to the first."""
    open_ends: tuple[OpenEnd, ...]
    """Two for an open chain (tail of the first wall, head of the last), none for a closed one."""

    @property
    def is_closed(self) -> bool:
        """Whether the chain surrounds a contour."""
        return not self.open_ends
