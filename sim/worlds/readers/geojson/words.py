"""What a feature's properties say that it is, in the words of several tools: our own, OpenStreetMap's, Apple's IMDF."""

import re
from collections.abc import Iterable
from typing import Any, Literal

Kind = Literal["room", "solid", "wall", "door", "outline", "nothing"]
ROOMS = ("room", "floor", "space", "hall", "corridor", "hallway", "passage", "area", "free", "unit", "walkway")
SOLIDS = ("solid", "obstacle", "island", "pillar", "column", "furniture", "block", "fixture", "kiosk", "structure")
DOORS = ("door", "doorway", "opening", "entrance", "gate")
OUTLINES = ("level", "storey", "building", "footprint", "venue", "outline")
"""The border of a storey or a building: a room only where nothing else is drawn."""
NOTHING = ("trajectory", "route", "path", "footway", "dimension", "axis", "grid", "annotation", "address", "anchor",
           "occupant", "amenity", "detail", "section", "geofence", "relationship", "zone", "poi")  # fmt: skip
WORDS: dict[str, Kind] = {
    **dict.fromkeys(ROOMS, "room"), **dict.fromkeys(SOLIDS, "solid"), "wall": "wall", "partition": "wall",
    "window": "wall", **dict.fromkeys(DOORS, "door"), **dict.fromkeys(OUTLINES, "outline"),
    **dict.fromkeys(NOTHING, "nothing"),
}  # fmt: skip
KEYS = ("contour", "kind", "type", "class", "category", "indoor", "feature_type")
OSM: dict[str, Kind] = {
    **dict.fromkeys(("door", "entrance"), "door"), "highway": "nothing",
    **dict.fromkeys(("building", "building:part"), "outline"),
}  # fmt: skip
"""Keys of OpenStreetMap that say it themselves, whatever their value."""
LEVELS = ("level", "level_id", "storey", "story", "floor", "ordinal")


def kind_of(properties: dict[str, Any], is_imdf: bool) -> Kind | None:
    """Return what a feature is; None where no property says it in a word that is known."""
    values = [properties.get(key) for key in KEYS]
    kinds = [WORDS[value.lower()] for value in values if isinstance(value, str) and value.lower() in WORDS]
    if is_imdf and properties.get("feature_type") != "unit":
        kinds = kinds[-1:]
    if kinds:
        return kinds[0]
    said = (kind for key, kind in OSM.items() if properties.get(key) not in (None, "no", False))
    return next(said, None)


def levels_of(properties: dict[str, Any]) -> frozenset[str]:
    """Return the storeys that a feature stands on; none where it does not say."""
    for key in LEVELS:
        value = properties.get(key)
        if isinstance(value, bool) or not isinstance(value, str | int | float):
            continue
        found: set[str] = set()
        for part in re.split(r"[;,]", str(value)):
            part = part.strip()
            ends = re.fullmatch(r"(-?\d+)-(-?\d+)", part)
            if ends and 0 <= int(ends[2]) - int(ends[1]) <= 200:
                found |= {str(n) for n in range(int(ends[1]), int(ends[2]) + 1)}
            elif part:
                found.add(level_name(part))
        return frozenset(found)
    return frozenset()


def level_name(text: str) -> str:
    """Return a storey's name; 1, 1.0 and " 1" are one."""
    try:
        return f"{float(text):g}"
    except ValueError:
        return text.strip()


def first_level(levels: Iterable[str]) -> str:
    """Return the storey that is read where nobody chooses: the ground floor, or the lowest above it, or the first."""

    def order(name: str) -> tuple[int, float, str]:
        try:
            number = float(name)
        except ValueError:
            return 2, 0.0, name
        return (0, number, name) if number >= 0 else (1, -number, name)

    return min(levels, key=order)
