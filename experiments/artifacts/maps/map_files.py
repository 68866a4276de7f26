"""The files of a run's map, `map.npz` and `map.geojson`, read again."""

from pathlib import Path
from typing import Any

import numpy as np
from msgspec import defstruct

from chainslam.sim.logs.archive import ArchiveError
from chainslam.sim.logs.recorded_robot import MOST_M, are_covariances, within

from ...usage import UsageError
from ..reading import read_arrays, read_json, told
from ..schema import UnfitError, fit, many

LAYOUT = {
    "pose": "float 3",
    "ids": "int n",
    "lines": "float n 2",
    "lines_world": "float n 2",
    "anchors": "float n 2",
    "extents": "float n 2",
    "sightings": "int n",
    "tentative": "bool n",
    "crooked": "bool n",
    "cov": "float c c",
}
PAIR = tuple[float, float]
Kind = defstruct("Kind", [("kind", str)])
Feature = defstruct("Feature", [("properties", Kind)])
Features = defstruct("Features", [("features", many(Feature))])
Point = defstruct("Point", [("coordinates", PAIR)])
OfCorner = defstruct(
    "OfCorner", [("chain", int), ("walls", tuple[int, int]), ("covariance_xy_m2", tuple[PAIR, PAIR] | None)]
)
Corner = defstruct("Corner", [("geometry", Point), ("properties", OfCorner)])
Way = defstruct("Way", [("coordinates", list[Any])])
OfChain = defstruct("OfChain", [("closed", bool), ("chain", int), ("walls", list[int])])
Chain = defstruct("Chain", [("geometry", Way), ("properties", OfChain)])
REMEDY = "name the folder of a run"


def read_map(folder: Path) -> dict[str, np.ndarray]:
    """Return the arrays of a run's `map.npz`; raises UsageError for anything else.

    The covariance is NaN throughout if the back end had lost it.
    """
    path = folder / "map.npz"
    arrays = read_arrays(path, LAYOUT, REMEDY)
    ids, cov = arrays["ids"], arrays["cov"]
    lost = bool(np.all(np.isnan(cov)))
    with told(path, REMEDY):
        if len(cov) != 3 + 2 * len(ids):
            raise ArchiveError(f"a covariance of {len(cov)} columns for {len(ids)} walls")
        if np.any(np.diff(ids) <= 0) or np.any(ids < 0):
            raise ArchiveError("wall ids that are not ascending")
        places = [arrays[name] for name in ("pose", "lines", "lines_world", "anchors", "extents")]
        if not all(within(values, MOST_M) for values in places):
            raise ArchiveError(f"positions that are NaN or beyond {MOST_M:g} m")
        if not lost and not (within(cov, MOST_M) and are_covariances(cov)):
            raise ArchiveError("an invalid covariance")
    return arrays


def read_joint(folder: Path) -> tuple[dict[str, np.ndarray], dict[str, list[dict[str, Any]]]]:
    """Return the arrays and the features of a run's map; raises UsageError for another, and for a lost covariance."""
    arrays = read_map(folder)
    features = read_features(folder, arrays["ids"])
    if not np.all(np.isfinite(arrays["cov"])):
        raise UsageError(
            "expected a map with its joint covariance, found one whose estimate was lost: take another run"
        )
    return arrays, features


def read_features(folder: Path, ids: np.ndarray) -> dict[str, list[dict[str, Any]]]:
    """Return the corners and the chains of a run's `map.geojson`, by kind; raises UsageError for anything else.

    `ids` are those of the map: whatever names another wall belongs to another map.
    """
    path = folder / "map.geojson"
    said = read_json(path, Features, REMEDY)
    features = {kind: [f for f in said["features"] if f["properties"]["kind"] == kind] for kind in ("corner", "chain")}
    known = set(ids.tolist())
    with told(path, REMEDY):
        fit(many(Corner), features["corner"], "corners")
        for feature in features["corner"]:
            if not within(np.array(feature["geometry"]["coordinates"]), MOST_M):
                raise UnfitError(f"a corner beyond {MOST_M:g} m")
        fit(many(Chain), features["chain"], "chains")
        for feature in features["chain"]:
            _way(feature)
        for feature in (*features["corner"], *features["chain"]):
            if not feature["properties"]["walls"] or not known.issuperset(feature["properties"]["walls"]):
                raise UnfitError("walls that are not in map.npz")
    return features


def _way(feature: dict[str, Any]) -> None:
    """Raise UnfitError if a chain has fewer than two points, or a closed chain is not exactly one ring."""
    way = feature["geometry"]["coordinates"]
    if feature["properties"]["closed"]:
        way = way[0] if len(way) == 1 else []
    points = fit(list[PAIR], way, "a chain's coordinates")
    if len(points) < 2 or not within(np.array(points), MOST_M):
        raise UnfitError("a chain that is not a path")
