"""How far each wall has moved along itself, where a correction moved the map: its line alone does not tell.

A line has a direction and a distance, and no place along itself. Where a loop is closed the map moves by decimetres.
Then the ends of a wall that were left behind would no longer meet those of its neighbours.
"""

import numpy as np
from jaxtyping import Float

from ..geometry.lines import directions, normals
from ..geometry.numerics import TINY
from ..geometry.poses import J


def along(
    middles_world: Float[np.ndarray, "m 2"],
    alpha: Float[np.ndarray, " m"],
    told_at_world: Float[np.ndarray, "n 2 2"],
    told_alpha: Float[np.ndarray, " n"],
    told_m: Float[np.ndarray, "n 2"],
    near_m: float,
) -> Float[np.ndarray, " m"]:
    """Return how far (m) each wall has moved along itself, by how far some have moved across themselves at their ends.

    Walls about one place move together, as a rigid body does: a shift and a turn about the middle of the wall, of least
    squared error over the ends of those that tell. Ends count by the inverse square of their distance, those within
    `near_m` about alike. What none of them tells is taken for none, as the shift along a corridor without a cross wall.
    """
    points, across_of = told_at_world.reshape(-1, 2), np.repeat(normals(told_alpha), 2, axis=0)
    arms = points - middles_world[:, None]
    weights = 1.0 / (1.0 + np.sum(arms**2, axis=-1) / near_m**2)
    rows = np.empty((len(alpha), len(points), 3))
    rows[..., :2] = across_of
    rows[..., 2] = np.einsum("mpk,pk->mp", arms @ J.T, across_of)
    weighed = (rows * weights[..., None]).swapaxes(1, 2)
    inverse = np.linalg.pinv(weighed @ rows, rcond=TINY, hermitian=True)
    motion = np.einsum("mij,mj->mi", inverse, weighed @ told_m.ravel())
    return np.asarray(np.vecdot(motion[:, :2], directions(alpha)))
