"""Pictures of a run's map and visibility graph over the truth, which is moved by the initial pose error."""

from collections.abc import Mapping
from typing import Any

import networkx as nx
import numpy as np
import shapely
from jaxtyping import Bool, Float

from chainslam.explore.goal import SetAside
from chainslam.explore.step import Step
from chainslam.sim.logs.keyframes import RecordedLog
from chainslam.sim.worlds import World
from chainslam.slam.geometry.poses import compose, inverse, to_world
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.viz.figures.maps import Picture, draw_map, png
from chainslam.viz.figures.visibility import GraphPicture, draw_graph
from chainslam.viz.shapes import with_gaps

from ...scenario import STRATEGY_OF_REPLAYS, TrialConfig
from ...scoring.maps.corners import corners
from ...scoring.maps.coverage import own_alignment
from ...scoring.records import Log, Route
from ...scoring.summary import odometry_poses
from ...trial import TrialResult
from .visibility import graph_words


def picture_of(result: TrialResult) -> bytes:
    """Return the PNG of a trial's map; raises ValueError if there was no step to draw."""
    return png(draw_map(map_picture(result)))


def map_picture(result: TrialResult) -> Picture:
    """Return the content of the picture of a trial's map; raises ValueError if there was no step to draw."""
    if result.log is None or result.last is None:
        raise ValueError("expected a run of at least one step, found none: there is no map to draw")
    log, last, scenario = result.log, result.last, result.scenario
    if result.recorded is not None:
        return _alone(result, log, last, result.recorded)
    known = [
        (corner.position_world, cov)
        for corner in corners(last.map, last.chains)
        if result.joint is not None and (cov := corner.cov(result.joint)) is not None
    ]
    return over_truth(
        scenario.world, scenario.config, result.summary, last.map, last.chains, last.set_aside, known,
        log.estimated_world, log.true_world, scenario.start_estimate, log.carried,
    )  # fmt: skip


def graph_png(result: TrialResult) -> bytes:
    """Return the PNG of a trial's map with its visibility graph; raises ValueError if there was no step to draw."""
    shown = map_picture(result)
    assert result.log is not None
    assert result.last is not None
    return png(draw_graph(graph_picture(shown, result.last.graph, result.log.longest_route)))


def graph_picture(shown: Picture, graph: "nx.DiGraph[int]", route: Route) -> GraphPicture:
    """Return the picture of a graph over the map of another picture."""
    walls = route.walls if len(route.walls) > 1 else ()
    title, words = f"{shown.title}: visibility graph", graph_words(graph, route)
    return GraphPicture(shown.map, shown.chains, graph, title, words, route=walls, true_floor=shown.true_floor)


def _alone(result: TrialResult, log: Log, last: Step, recorded: RecordedLog) -> Picture:
    """Return the picture of a recorded drive: without the truth, but with the path of the wheel odometry."""
    summary, config = result.summary, result.scenario.config
    looked = summary.get("second_looks", summary)
    words = [
        f"{summary['status']} after {summary['steps']} steps, {summary['path_length_m']:.1f} m",
        *([] if looked["lines"] is None else [f"{looked['lines']} walls, {looked['chains_closed']} closed chains"]),
    ]
    return Picture(
        map=last.map,
        chains=last.chains,
        path_world=log.estimated_world if result.smoothed is None else result.smoothed.poses_world,
        title=f"{result.scenario.world.name}   {config.backend if looked is summary else 'offline refinement'}",
        subtitle=";  ".join(words),
        odometry_path_world=odometry_poses(log.estimated_world[0], recorded.recording.odometry[: len(log)]),
        radius_m=config.robot.radius_m,
        was_explored=config.strategy != STRATEGY_OF_REPLAYS,
    )


def over_truth(
    world: World,
    config: TrialConfig,
    summary: Mapping[str, Any],
    walls: StochasticMap,
    chains: tuple[Chain, ...],
    set_aside: tuple[SetAside, ...],
    corners_with_covs: list[tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2 2"]]],
    estimated_world: Float[np.ndarray, "s 3"],
    true_world: Float[np.ndarray, "s 3"],
    start_estimate: Float[np.ndarray, "3"],
    carried: Bool[np.ndarray, " s"] | None = None,
) -> Picture:
    """Return the content of the picture of a map; its paths have a gap where the robot was `carried`."""
    to_estimate = inverse(own_alignment(start_estimate, estimated_world, true_world, summary["map_began_step"]))
    rings = (world.free.exterior, *world.free.interiors)
    off_cm, wheels_cm = 100 * summary["pose_rmse_m"], 100 * summary["odometry_rmse_m"]
    laid_over = " aligned with the truth" if summary["map_began_step"] else ""
    of_map = [
        f"{summary['contours_closed']} of {summary['contours_reachable']} contours closed",
        f"coverage {100 * (summary['coverage_own_frame'] or 0.0):.1f} %{laid_over}",
    ]
    words = [
        f"{summary['status']} after {summary['steps']} steps, {summary['path_length_m']:.1f} m",
        *([] if summary["coverage_own_frame"] is None else of_map),
        f"pose error rms {off_cm:.1f} cm (odometry alone {wheels_cm:.0f} cm)",
    ]
    noise = "errorless" if config.errorless else f"seed {config.seed}"
    how = "replayed" if config.strategy == STRATEGY_OF_REPLAYS else config.strategy
    return Picture(
        map=walls,
        chains=chains,
        path_world=with_gaps(estimated_world, carried),
        title=f"{world.name}   {config.backend}, {how}, {noise}",
        subtitle=";  ".join(words),
        set_aside=set_aside,
        true_path_world=with_gaps(np.array([compose(to_estimate, pose) for pose in true_world]), carried),
        corners_world=np.array([place for place, _ in corners_with_covs]).reshape(-1, 2),
        corner_covs=np.array([cov for _, cov in corners_with_covs]).reshape(-1, 2, 2),
        true_floor=tuple(to_world(shapely.get_coordinates(ring)[:-1], to_estimate) for ring in rings),
        radius_m=config.robot.radius_m,
    )
