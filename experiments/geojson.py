"""The map as GeoJSON: walls, corners and chains with their covariances, in local metres."""

from typing import Any

import numpy as np

from explore.step import Step
from slam.backend import Joint
from slam.chains import Chain
from slam.stochastic_map import StochasticMap

from .corners import Corner, corners

FRAME = "local metres of the map's world frame, x right, y up; not WGS 84 degrees"


def map_geojson(step: Step, joint: Joint | None) -> dict[str, Any]:
    """Return the map of one step; covariances of corners are null without the joint covariance."""
    walls, chains = step.map, step.chains
    found = corners(walls, chains)
    return {
        "type": "FeatureCollection",
        "coordinate_system": FRAME,
        "features": [
            *_wall_features(walls, chains, joint),
            *(_corner_feature(k, corner, joint) for k, corner in enumerate(found)),
            *(_chain_feature(k, chain, walls) for k, chain in enumerate(chains)),
        ],
    }


def _feature(geometry: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    return {
        "type": "Feature",
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": properties,
    }


def _wall_features(walls: StochasticMap, chains: tuple[Chain, ...], joint: Joint | None) -> list[dict[str, Any]]:
    chain_of = {wall: index for index, chain in enumerate(chains) for wall in chain.walls}
    features = []
    for row, wall in enumerate(walls.ids.tolist()):
        own = slice(3 + 2 * row, 5 + 2 * row)
        features.append(
            _feature(
                "LineString",
                walls.ends_world[row],
                kind="wall",
                id=wall,
                chain=chain_of.get(wall),
                tentative=bool(walls.tentative[row]),
                sightings=int(walls.sightings[row]),
                alpha_rad=walls.belief.means[row, 0],
                d_m=walls.belief.means[row, 1],
                anchor_m=walls.belief.anchors[row],
                covariance_alpha_d=None if joint is None else joint.cov[own, own],
            )
        )
    return features


def _corner_feature(index: int, corner: Corner, joint: Joint | None) -> dict[str, Any]:
    return _feature(
        "Point",
        corner.position_world,
        kind="corner",
        id=index,
        chain=corner.chain,
        walls=corner.walls,
        covariance_xy_m2=None if joint is None else corner.cov(joint),
    )


def _chain_feature(index: int, chain: Chain, walls: StochasticMap) -> dict[str, Any]:
    properties = {
        "kind": "chain",
        "id": index,
        "walls": chain.walls,
        "closed": chain.is_closed,
        "open_ends": [
            {"wall": end.wall, "side": end.side, "position_m": end.position_world} for end in chain.open_ends
        ],
    }
    if chain.is_closed and len(chain.corners_world) > 2:
        ring = np.concatenate([chain.corners_world, chain.corners_world[:1]])
        return _feature("Polygon", [ring], **properties)
    ends = walls.ends_world[walls.belief.rows((chain.walls[0], chain.walls[-1]))]
    return _feature("LineString", np.concatenate([ends[:1, 0], chain.corners_world, ends[1:, 1]]), **properties)
