"""What clips and masks let be seen."""

from dataclasses import replace
from typing import Any
from xml.etree.ElementTree import Element

import shapely
import svgelements
from shapely.geometry.base import BaseGeometry
from tinycss2 import serialize

from .cascade import Style
from .document import kind
from .paint import url_of
from .pieces import filled, leaves
from .place import DEEPEST, Place, Walk, both, box_around, is_gone, overlaid
from .shapes import SHAPES, length, matrix, placed

SHOWN = 0.5
"""A mask lets through what it paints lighter than this."""


def seen_of(walk: Walk, element: Element, style: Style, place: Place, depth: int) -> BaseGeometry | None:
    """Return what may be seen of an element, page frame; None for all of it."""
    clip = place.clip
    for name, kind_of, region in (("clip-path", "clipPath", _clip), ("mask", "mask", _mask)):
        tokens = style.tokens(name)
        if not tokens or getattr(tokens[0], "lower_value", "") in ("none", "initial", "inherit", "unset"):
            continue
        number = url_of(tokens[0])
        target = None if number is None else walk.named.get(number)
        if target is None or kind(target) != kind_of or depth > DEEPEST:
            walk.styles.note(f"{name} {serialize(tokens)}")
            continue
        clip = both(clip, region(walk, target, element, style, place, depth + 1))
    return clip


def _clip(walk: Walk, target: Element, element: Element, style: Style, place: Place, depth: int) -> BaseGeometry:
    own = walk.styles.of(target, None)
    frame = _unit_frame(walk, target.get("clipPathUnits"), element, style, place)
    frame = matrix(own.text("transform")) * frame
    shown: list[BaseGeometry] = []
    for child in target:
        if kind(child) not in (*SHAPES, "use"):
            continue
        at = walk.within(child, kind(child), walk.styles.of(child, own), Place(own, frame, place.whole))
        assert at.style is not None
        if is_gone(at.style) or at.style.word("visibility") != "visible":
            continue
        rings = walk.outlines(child, at.style, at)
        part = shapely.union_all(filled(rings, at.style.word("clip-rule") == "evenodd"))
        more = seen_of(walk, child, at.style, at, depth)
        shown.append(part if more is None else part.intersection(more))
    region = shapely.union_all(shown)
    more = seen_of(walk, target, own, replace(place, clip=None, frame=frame), depth)
    return region if more is None else region.intersection(more)


def _mask(walk: Walk, target: Element, element: Element, style: Style, place: Place, depth: int) -> BaseGeometry:
    own = walk.styles.of(target, None)
    of_box = target.get("maskUnits", "objectBoundingBox") == "objectBoundingBox"
    wholes = (1.0, 1.0) if of_box else place.whole
    x, y = (length(target.get(key, "-10%"), of) for key, of in zip("xy", wholes, strict=True))
    size = [length(target.get(key, "120%"), of) for key, of in zip(("width", "height"), wholes, strict=True)]
    frame = _unit_frame(walk, "objectBoundingBox" if of_box else None, element, style, place)
    page = placed((x, y, size[0], size[1]), frame)
    inside = Place(own, _unit_frame(walk, target.get("maskContentUnits"), element, style, place), place.whole, page)
    painted = leaves([each for child in target for each in walk.plain(child, inside, depth)])
    if own.word("mask-type") == "alpha":
        return overlaid(painted, lambda paint: paint.alpha >= SHOWN, lambda paint: False)
    return overlaid(
        painted,
        lambda paint: paint.lightness * paint.alpha >= SHOWN,
        lambda paint: paint.lightness < SHOWN <= paint.alpha,
    )


def _unit_frame(walk: Walk, units: str | None, element: Element, style: Style, place: Place) -> Any:
    """Return the frame of what is measured in units of the page, or of the box around an element."""
    if units != "objectBoundingBox":
        return place.frame
    x, y, width, height = box_around(walk, element, style, place) or (0.0, 0.0, 0.0, 0.0)
    return svgelements.Matrix(width, 0, 0, height, x, y) * place.frame
