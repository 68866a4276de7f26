"""The picture beside a trial's results: the estimate, and the truth moved by the initial pose error under it."""

import numpy as np
import shapely
from jaxtyping import Float

from slam.geometry.poses import compose, inverse, to_world
from viz.figures import Picture, draw_map, png

from .corners import corners
from .coverage import alignment
from .trial import TrialResult


def picture_of(result: TrialResult) -> bytes:
    """Return the PNG of a trial's map; raises ValueError where there was no step to draw."""
    if result.log is None or result.last is None:
        raise ValueError("expected a run of at least one step, found none: there is no map to draw")
    log, summary, config = result.log, result.summary, result.scenario.config
    to_estimate = inverse(alignment(result.scenario.start_estimate, log.true_world[0]))
    free = result.scenario.world.free
    rings = tuple(
        to_world(shapely.get_coordinates(ring)[:-1], to_estimate) for ring in (free.exterior, *free.interiors)
    )
    known, covs = _corners(result)
    words = [
        f"{summary['status']} after {summary['steps']} steps, {summary['path_length_m']:.1f} m",
        f"{summary['contours_closed']} of {summary['contours_reachable']} contours closed",
        f"coverage {100 * summary['coverage']:.1f} %",
        f"pose error {100 * summary['pose_rmse_m']:.1f} cm rms (wheels alone: {summary['odometry_max_m']:.2f} m)",
    ]
    noise = "errorless" if config.errorless else f"seed {config.seed}"
    return png(
        draw_map(
            Picture(
                map=result.last.map,
                chains=result.last.chains,
                path_world=log.estimated_world,
                title=f"{result.scenario.world.name}   {config.backend}, {config.strategy}, {noise}",
                subtitle="grid 1 m;  " + ";  ".join(words),
                set_aside=result.last.set_aside,
                true_path_world=np.array([compose(to_estimate, pose) for pose in log.true_world]),
                corners_world=known,
                corner_covs=covs,
                true_floor=rings,
            )
        )
    )


def _corners(result: TrialResult) -> tuple[Float[np.ndarray, "c 2"], Float[np.ndarray, "c 2 2"]]:
    """Return the corners of the last map whose covariance is known, and their covariances."""
    if result.last is None or result.joint is None:
        return np.zeros((0, 2)), np.zeros((0, 2, 2))
    joint = result.joint
    known = [
        (corner.position_world, cov)
        for corner in corners(result.last.map, result.last.chains)
        if (cov := corner.cov(joint)) is not None
    ]
    return (
        np.array([place for place, _ in known]).reshape(-1, 2),
        np.array([cov for _, cov in known]).reshape(-1, 2, 2),
    )
