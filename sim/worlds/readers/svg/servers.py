"""Gradients and patterns by their mean paint: a plan has no use for what lies where in them."""

from xml.etree.ElementTree import Element

import numpy as np
import svgelements

from .document import kind, link
from .paint import NOTHING, Paint, Server
from .pieces import leaves
from .place import DEEPEST, Place, Walk, box_around, overlaid
from .shapes import length, placed, view_box


def mean_paint(walk: Walk, server: Server, element: Element, place: Place, depth: int) -> Paint:
    """Return the mean paint of a gradient or a pattern."""
    target = walk.named.get(server.id)
    name = "" if target is None else kind(target)
    if target is None or name not in ("linearGradient", "radialGradient", "pattern") or depth > DEEPEST:
        walk.styles.note(f"url(#{server.id})")
        return server.otherwise
    walk.found.averaged += 1
    chain = _chain(walk, target)
    if name != "pattern":
        return _gradient(walk, next(([s for s in each if kind(s) == "stop"] for each in chain if len(each)), []))
    said: dict[str, str] = {}
    for each in reversed(chain):
        said.update(each.attrib)
    content = next((each for each in chain if any(kind(child) for child in each)), target)
    return _pattern(walk, content, said, element, place, depth)


def _chain(walk: Walk, target: Element) -> list[Element]:
    """Return a gradient or a pattern, and those that it takes after, in order."""
    chain = [target]
    while len(chain) < DEEPEST and (more := walk.named.get(link(chain[-1]))) is not None and more not in chain:
        chain.append(more)
    return chain


def _gradient(walk: Walk, stops: list[Element]) -> Paint:
    paints: list[Paint] = []
    places: list[float] = []
    for stop in stops:
        style = walk.styles.of(stop, None)
        paint = style.paint("stop-color")
        paints.append((paint if isinstance(paint, Paint) else NOTHING).faded(style.opacity("stop-opacity")))
        places.append(min(max(length(stop.get("offset", "0"), 1.0), 0.0, *places[-1:]), 1.0))
    if not paints:
        return NOTHING
    at = np.linspace(0.0, 1.0, 101)
    alpha = float(np.mean(np.interp(at, places, [each.alpha for each in paints])))
    return Paint(float(np.mean(np.interp(at, places, [each.lightness for each in paints]))), alpha)


def _pattern(walk: Walk, content: Element, said: dict[str, str], element: Element, place: Place, depth: int) -> Paint:
    box = view_box(said.get("viewBox"))
    of_box = said.get("patternUnits", "objectBoundingBox") == "objectBoundingBox"
    assert place.style is not None
    around = box_around(walk, element, place.style, place) or (0.0, 0.0, 1.0, 1.0)
    wholes = (1.0, 1.0) if of_box else place.whole
    sizes = [length(said.get(key, "0"), of) for key, of in zip(("width", "height"), wholes, strict=True)]
    x, y = (length(said.get(key, "0"), of) for key, of in zip("xy", wholes, strict=True))
    if of_box and said.get("patternContentUnits") != "objectBoundingBox":
        sizes, x, y = [s * w for s, w in zip(sizes, around[2:], strict=True)], x * around[2], y * around[3]
    tile = box or (x if not of_box else 0.0, y if not of_box else 0.0, *sizes)
    if not min(sizes) > 0.0 or not min(tile[2:]) > 0.0:
        return NOTHING
    page = placed(tile, svgelements.Matrix())  # type: ignore[arg-type]
    inside = Place(walk.styles.of(content, None), svgelements.Matrix(), place.whole, page)
    painted = leaves([p for child in content for p in walk.plain(child, inside, depth + 1)])
    dark = overlaid(painted, lambda paint: paint.is_dark, lambda paint: paint.hides)
    light = overlaid(painted, lambda paint: paint.hides, lambda paint: paint.is_dark)
    share = (dark.area + light.area) / page.area
    shades = [each.paint for each in painted if each.paint.is_dark] or [Paint(0.0, 1.0)]
    shade = sum(each.lightness * each.alpha + 1 - each.alpha for each in shades) / len(shades)
    mean = (dark.area * shade + light.area) / (share * page.area) if share else 1.0
    return Paint(mean, min(share, 1.0))
