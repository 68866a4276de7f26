"""How far an estimated path is from the true one: absolute and relative errors, as `evo` defines them."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import rotation, to_world, wrap


def position_errors(
    estimated_world: Float[np.ndarray, "s 3"], true_world: Float[np.ndarray, "s 3"]
) -> Float[np.ndarray, " s"]:
    """Return the distance m of each estimated position from the true one; nothing is aligned."""
    return np.hypot(*(estimated_world[:, :2] - true_world[:, :2]).T)


def ate(estimated_world: Float[np.ndarray, "s 3"], true_world: Float[np.ndarray, "s 3"], align: bool = False) -> float:
    """Return the absolute trajectory error: rms distance m of the positions.

    With `align` the whole path is first moved by the rigid motion that makes it least (Umeyama, without scale).
    """
    if align:
        estimated_world = aligned(estimated_world, true_world)
    return rms(position_errors(estimated_world, true_world))


def aligned(
    estimated_world: Float[np.ndarray, "s 3"], true_world: Float[np.ndarray, "s 3"]
) -> Float[np.ndarray, "s 3"]:
    """Return the estimated path after the rigid motion that brings its positions nearest to the true ones."""
    return moved(estimated_world, alignment_of_paths(estimated_world, true_world))


def moved(poses_world: Float[np.ndarray, "s 3"], motion: Float[np.ndarray, "3"]) -> Float[np.ndarray, "s 3"]:
    """Return poses after a rigid motion (m, m, rad) of the world."""
    return np.column_stack([to_world(poses_world[:, :2], motion), wrap(poses_world[:, 2] + motion[2])])


def alignment_of_paths(
    estimated_world: Float[np.ndarray, "s 3"], true_world: Float[np.ndarray, "s 3"]
) -> Float[np.ndarray, "3"]:
    """Return the rigid motion (m, m, rad) that brings the estimated positions nearest to the true ones."""
    from_centre, to_centre = estimated_world[:, :2].mean(axis=0), true_world[:, :2].mean(axis=0)
    a, b = estimated_world[:, :2] - from_centre, true_world[:, :2] - to_centre
    turn = float(np.arctan2(np.sum(a[:, 0] * b[:, 1] - a[:, 1] * b[:, 0]), np.sum(a * b)))
    return np.append(to_centre - rotation(turn) @ from_centre, turn)


def rpe(
    estimated_world: Float[np.ndarray, "s 3"], true_world: Float[np.ndarray, "s 3"], every: int = 1
) -> tuple[float, float]:
    """Return the relative pose error over `every` steps, over all pairs: rms of the shift m and of the turn rad.

    It compares estimated with true motions, each seen from its own beginning, and needs no alignment. Raises
    ValueError where the path is not longer than that.
    """
    if len(true_world) <= every:
        raise ValueError(f"expected more than {every} poses, found {len(true_world)}: compare over fewer steps")
    estimated, true = _motions(estimated_world, every), _motions(true_world, every)
    return rms(position_errors(estimated, true)), rms(wrap(estimated[:, 2] - true[:, 2]))


def _motions(poses_world: Float[np.ndarray, "s 3"], every: int) -> Float[np.ndarray, "m 3"]:
    before, after = poses_world[:-every], poses_world[every:]
    c, s = np.cos(before[:, 2]), np.sin(before[:, 2])
    dx, dy = (after - before)[:, :2].T
    return np.column_stack([c * dx + s * dy, c * dy - s * dx, wrap(after[:, 2] - before[:, 2])])


def rms(values: Float[np.ndarray, " n"]) -> float:
    """Return the root of the mean square."""
    return float(np.sqrt(np.mean(values**2)))
