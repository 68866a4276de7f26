"""The map as GeoJSON, in local metres: walls and corners with covariances, chains, open ends and unseen floor."""

from collections.abc import Iterable
from typing import Any

import numpy as np
import shapely

from chainslam.explore.certificate import Certificate, ClosedContour, LeftFrontier, LeftObstacle, LeftOpen
from chainslam.explore.step import Step
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap

from ...scoring.maps.corners import Corner, corners
from ...scoring.records import Log
from ...scoring.without_truth.certificate import contour_record, frontier_record, obstacle_record, open_end_record
from ..files import stamp

FRAME = "local metres of the map's world frame, x right, y up; not the longitudes and latitudes of RFC 7946"
LOCAL_METRES = 'LOCAL_CS["local metres",UNIT["metre",1]]'


def map_geojson(step: Step, joint: Joint | None, certificate: Certificate, log: Log) -> dict[str, Any]:
    """Return the map of the last step with what the mission can vouch for; covariances are null without `joint`.

    RFC 7946 knows longitudes and latitudes only. A building's map has none, so the file says so twice: in words, and
    as the `crs` of the GeoJSON of 2008, which GDAL (and so QGIS) reads as a local system in metres.
    """
    walls, chains = step.map, step.chains
    found = corners(walls, chains)
    return {
        "type": "FeatureCollection",
        "name": "map",
        **stamp(),
        "crs": {"type": "name", "properties": {"name": LOCAL_METRES}},
        "coordinate_system": FRAME,
        "features": [
            *(_contour_feature(contour) for contour in certificate.contours),
            *(_chain_feature(k, chain, walls) for k, chain in enumerate(chains) if not chain.is_closed),
            *_wall_features(walls, chains, joint),
            *(_corner_feature(k, corner, joint) for k, corner in enumerate(found)),
            *(_open_end_feature(end) for end in certificate.open_ends),
            *_numbered(_frontier_feature(border) for border in certificate.frontiers or ()),
            *_numbered(_obstacle_feature(thing) for thing in certificate.obstacles or ()),
            _trajectory_feature(log),
            _start_feature(log),
        ],
    }


def _feature(geometry: str, coordinates: Any, **properties: Any) -> dict[str, Any]:
    """Return a feature whose id is unique in the file: its kind with its number, where it has one."""
    return {
        "type": "Feature",
        "id": _id_of(properties),
        "geometry": {"type": geometry, "coordinates": coordinates},
        "properties": properties,
    }


def _id_of(properties: dict[str, Any]) -> str:
    kind = str(properties["kind"])
    numbers = {"wall": ("id",), "corner": ("id",), "chain": ("chain",), "open-end": ("wall", "side")}.get(kind, ())
    return "-".join([kind, *(str(properties[name]) for name in numbers)])


def _numbered(features: Iterable[dict[str, Any]]) -> list[dict[str, Any]]:
    return [feature | {"id": f"{feature['id']}-{number}"} for number, feature in enumerate(features)]


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
                crooked=bool(walls.crooked[row]),
                observations=int(walls.observations[row]),
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


def _contour_feature(contour: ClosedContour) -> dict[str, Any]:
    """Return a closed chain; the corners of the polygon are those of the chain."""
    ring = shapely.get_coordinates(contour.polygon)
    return _feature("Polygon", [ring], kind="chain", closed=True, **contour_record(contour))


def _chain_feature(index: int, chain: Chain, walls: StochasticMap) -> dict[str, Any]:
    """Return a chain that is open at both its ends."""
    ends = walls.ends_world[walls.belief.rows((chain.walls[0], chain.walls[-1]))]
    way = np.concatenate([ends[:1, 0], chain.corners_world, ends[1:, 1]])
    return _feature("LineString", way, kind="chain", closed=False, chain=index, walls=chain.walls)


def _open_end_feature(end: LeftOpen) -> dict[str, Any]:
    return _feature("Point", end.position_world, kind="open-end", **open_end_record(end))


def _frontier_feature(border: LeftFrontier) -> dict[str, Any]:
    return _feature("MultiPoint", border.cells_world, kind="unseen", **frontier_record(border))


def _obstacle_feature(thing: LeftObstacle) -> dict[str, Any]:
    return _feature("MultiPoint", thing.cells_world, kind="unexplained", **obstacle_record(thing))


def _trajectory_feature(log: Log) -> dict[str, Any]:
    """Return the estimated path; a run of one step has a path of zero length."""
    way = log.estimated_world[:, :2] if len(log) > 1 else np.repeat(log.estimated_world[:, :2], 2, axis=0)
    return _feature("LineString", way, kind="trajectory", steps=len(log), path_length_m=log.path_length_m[-1])


def _start_feature(log: Log) -> dict[str, Any]:
    """Return the estimated start, so that the map can be explored as a world."""
    x, y, heading = log.estimated_world[0]
    return _feature("Point", [x, y], kind="start", id="start", heading=heading)
