"""The plain geometries of a GeoJSON object, each with what its feature says of it."""

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

import numpy as np
from jaxtyping import Float

from ...drawing import WorldError, numbers, shorten
from ...text import name_of
from .words import Kind, kind_of, level_name, levels_of

PIECES_MAX = 500_000
OWN = "coordinate_system"
"""A member that the maps have that this program writes; of these only chains and the start are read."""
OWN_KINDS = ("chain", "start")


@dataclass(frozen=True)
class About:
    """What a feature says of its geometry."""

    name: str | None = None
    heading: float = 0.0
    kind: Kind | None = None
    unknown: str = ""
    """Its property `kind`, where that is no word that is known and no other property is one."""
    is_own: bool = False
    """Whether it is a part of a map that this program wrote."""
    is_walled: bool = False
    """Whether its tool draws rooms that share their walls, with the doors apart."""
    levels: frozenset[str] = frozenset()
    width: float | None = None
    """Of a door, m."""


def features(document: dict[str, Any]) -> list[tuple[dict[str, Any], About]]:
    """Return all geometries; raises WorldError where a part is no GeoJSON."""
    return list(_geometries(document, About(), 0, OWN in document, _level_names(document)))


def positions(value: Any, least: int) -> Float[np.ndarray, "n 2"]:
    """Return the positions of a line or a ring, without heights."""
    path = [position(each) for each in listed(value, "coordinates")]
    if len(path) < least:
        raise WorldError(f"expected {least} or more positions, found {len(path)}: correct the line or ring")
    return np.array(path)


def position(value: Any) -> Float[np.ndarray, "2"]:
    """Return a position without its height."""
    return numbers(value, (2, 3), "a position", "[x, y]")[:2]


def listed(value: Any, what: str) -> list[Any]:
    """Return a list of sensible length."""
    if not isinstance(value, list) or len(value) > PIECES_MAX:
        raise WorldError(f"expected {what} to hold a list, found {shorten(value)}: correct the file")
    return value


def _geometries(
    node: Any, about: About, depth: int, is_own: bool, levels: dict[str, str]
) -> Iterator[tuple[dict[str, Any], About]]:
    if node is None:
        return
    if not isinstance(node, dict) or depth > 20:
        raise WorldError(f"expected a GeoJSON object, found {shorten(node)}: correct the file")
    kind = node.get("type")
    if kind == "FeatureCollection":
        for feature in listed(node.get("features"), "features"):
            yield from _geometries(feature, About(), depth + 1, is_own, levels)
    elif kind == "GeometryCollection":
        for part in listed(node.get("geometries"), "geometries"):
            yield from _geometries(part, about, depth + 1, is_own, levels)
    elif kind == "Feature":
        properties = node.get("properties") or {}
        if not isinstance(properties, dict):
            raise WorldError(f"expected properties to be an object, found {shorten(properties)}: correct the file")
        if not is_own or properties.get("kind") in OWN_KINDS:
            said = _about(node, properties, is_own, levels)
            yield from _geometries(node.get("geometry"), said, depth + 1, is_own, levels)
    else:
        yield node, about


def _about(node: dict[str, Any], properties: dict[str, Any], is_own: bool, levels: dict[str, str]) -> About:
    names = (node.get("id"), properties.get("id"), properties.get("name"))
    called = [str(n) for n in names if isinstance(n, str | int) and not isinstance(n, bool)]
    turn = numbers([properties.get("heading", 0.0)], (1,), "heading", "1.57")
    marks = [*called, properties["kind"]] if isinstance(properties.get("kind"), str) else called
    best = "start" if "start" in [mark.lower() for mark in marks] else name_of(called[-1]) if called else None
    is_imdf = isinstance(node.get("feature_type"), str)
    if is_imdf:
        properties = {**properties, "feature_type": node["feature_type"]}
    kind = kind_of(properties, is_imdf)
    unknown = "" if kind or is_own or properties.get("kind") is None else shorten(properties["kind"])
    storeys = frozenset() if is_own else frozenset(levels.get(each, each) for each in levels_of(properties))
    wide = properties.get("width")
    width = float(wide) if isinstance(wide, int | float) and not isinstance(wide, bool) and 0.3 <= wide <= 5 else None
    walled = is_imdf or properties.get("indoor") in ("room", "corridor")
    return About(best, float(turn[0]), kind, unknown, is_own, walled, storeys, width)


def _level_names(document: dict[str, Any]) -> dict[str, str]:
    """Return what the storeys that are features themselves (IMDF) are called, by their id."""
    nodes = document.get("features") if isinstance(document.get("features"), list) else []
    assert isinstance(nodes, list)
    names = {}
    for node in nodes:
        if isinstance(node, dict) and node.get("feature_type") == "level" and isinstance(node.get("properties"), dict):
            ordinal, number = node["properties"].get("ordinal"), node.get("id")
            if isinstance(ordinal, int) and isinstance(number, str):
                names[number] = level_name(str(ordinal))
    return names
