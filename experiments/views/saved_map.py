"""The picture of a map from the files of a run, so that it can be drawn again as vectors."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float
from msgspec import Struct

from chainslam.explore.goal import SetAside
from chainslam.slam.estimation.backend import Belief, Joint, StaleBeliefError
from chainslam.slam.map.chains import HEAD, TAIL, Chain, OpenEnd
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.viz.figures.maps import Picture
from chainslam.viz.figures.panels import SmallMap

from ..artifacts.maps.map_files import read_features, read_map
from ..artifacts.maps.picture import over_truth
from ..artifacts.reading import told
from ..artifacts.saved import REMEDY, read_summary
from ..artifacts.schema import fit
from ..scenario import TrialConfig, load_world


class Told(Struct):
    """The keys of a run's summary that the picture shows."""

    path_length_m: float
    coverage_own_frame: float
    pose_rmse_m: float
    odometry_rmse_m: float
    contours_closed: int
    contours_reachable: int
    map_began_step: int


def saved_map(
    folder: Path,
    trial: TrialConfig,
    log: Mapping[str, np.ndarray],
    walls: Mapping[str, np.ndarray],
    estimated_world: Float[np.ndarray, "s 3"],
) -> Picture:
    """Return the picture of a run's map from its folder and its arrays; raises UsageError if a file is missing."""
    features = read_features(folder, walls["ids"])
    summary = read_summary(folder)
    with told(folder / "summary.json", REMEDY):
        fit(Told, summary)
    covs = [
        (np.array(feature["geometry"]["coordinates"]), np.array(feature["properties"]["covariance_xy_m2"]))
        for feature in features["corner"]
        if feature["properties"]["covariance_xy_m2"] is not None
    ]
    aside = [
        SetAside(end["wall"], end["side"], np.array(end["position_m"]), end["why"])
        for end in summary.get("set_aside") or ()
    ]
    world = load_world(trial.world, trial.start, trial.drawing)
    return over_truth(
        world, trial, summary, _map(walls), _chains(features["chain"]),
        tuple(aside), covs, estimated_world, log["true_poses"], log["start_pose"], log.get("carried"),
    )  # fmt: skip


def picture_alone(folder: Path, path_world: Float[np.ndarray, "s 3"]) -> Picture:
    """Return the picture of a map without the truth, from a run's folder; raises UsageError."""
    walls = read_map(folder)
    return Picture(_map(walls), _chains(read_features(folder, walls["ids"])["chain"]), path_world, "")


def _map(walls: Mapping[str, np.ndarray]) -> StochasticMap:
    belief = Belief(
        walls["pose"], walls["cov"][:3, :3], walls["ids"], walls["anchors"], walls["lines"], _not_to_be_asked
    )
    return StochasticMap(belief, walls["extents"], walls["sightings"], walls["tentative"], walls["crooked"])


def small_map(shown: Picture) -> SmallMap:
    """Return the map of a picture for a comparison side by side."""
    closed = [wall for chain in shown.chains if chain.is_closed for wall in chain.walls]
    walls = shown.map
    is_closed = np.isin(walls.ids, closed)
    return SmallMap("", walls.ends_world, is_closed, walls.tentative, shown.path_world[:, :2], shown.true_floor)


def _not_to_be_asked(ids: np.ndarray) -> Joint:
    raise StaleBeliefError("expected a back end at work, found its results on disk: read the joint covariance there")


def _chains(features: Sequence[Mapping[str, Any]]) -> tuple[Chain, ...]:
    """Return the chains in their original order; a file lists the closed ones first."""
    found: dict[int, Chain] = {}
    for feature in features:
        says, way = feature["properties"], feature["geometry"]["coordinates"]
        members = tuple(says["walls"])
        if says["closed"]:
            found[says["chain"]] = Chain(members, np.array(way[0][:-1]), ())
        else:
            ends = (OpenEnd(members[0], TAIL, np.array(way[0])), OpenEnd(members[-1], HEAD, np.array(way[-1])))
            found[says["chain"]] = Chain(members, np.array(way[1:-1]).reshape(-1, 2), ends)
    return tuple(chain for _, chain in sorted(found.items()))
