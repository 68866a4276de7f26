"""What of a document is rendered, and where: groups, copies, viewports, clips and masks resolved to pieces of paint."""

import math
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import shapely
import svgelements
from shapely.geometry.base import BaseGeometry
from tinycss2 import serialize

from ...limits import check_count
from ...options import DrawingOptions
from .cascade import Style, Styles
from .document import kind, link, names
from .paint import NOTHING, Paint, Server, url_of
from .pieces import Group, Piece, leaves
from .shapes import SHAPES, Box, Ring, bounds, length, matrix, placed, rings_of, view, view_box
from .winding import filled

GROUPS = ("g", "a", "svg", "switch", "use")
LEFT_OUT = {"text": "text", "image": "picture", "foreignObject": "foreign object"}
"""Elements that are to be seen, and that are no walls."""
MARKERS = ("marker", "marker-start", "marker-mid", "marker-end")
DEEPEST = 30
"""Clips of clips, masks in masks, patterns of patterns."""
SHOWN = 0.5
"""A mask lets through what it paints lighter than this."""


@dataclass(frozen=True, eq=False)
class Place:
    """Where an element stands: what comes down to it from around."""

    style: Style | None
    frame: Any
    whole: tuple[float, float]
    """Width and height that shares are of."""
    clip: BaseGeometry | None = None
    layers: tuple[str, ...] = ()
    ids: tuple[str, ...] = ()
    size: tuple[str, str] = ("", "")
    """Width and height that a <use> gives to what it copies."""


@dataclass
class Found:
    """What the walk has met beside pieces of paint."""

    marks: dict[str, tuple[float, float, float]] = field(default_factory=dict)
    layers: set[str] = field(default_factory=set)
    ids: set[str] = field(default_factory=set)
    left_out: dict[str, int] = field(default_factory=dict)
    averaged: int = 0
    count: int = 0


class Renderer:
    """Walks through a document as a viewer does."""

    def __init__(self, root: Element, options: DrawingOptions) -> None:
        self.found, self.styles, self._options = Found(), Styles(root), options
        self._named: dict[str, Element] = {}
        for element in root.iter():
            if number := element.get("id"):
                self._named.setdefault(number, element)

    def root(self, root: Element, place: Place) -> list[Piece | Group]:
        """Return what is painted of a document in a frame of its page."""
        style = self.styles.of(root, None)
        if is_gone(style):
            return []
        inside = replace(place, style=style)
        painted = [each for child in root for each in self.pieces(child, inside)]
        opacity = style.opacity("opacity")
        return painted if opacity == 1.0 else [Group(opacity, painted)] if opacity else []

    def pieces(self, element: Element, place: Place, depth: int = 0, marks: bool = True) -> list[Piece | Group]:
        """Return what is painted of an element and those within, in order."""
        name = kind(element)
        if not (name in GROUPS or name in SHAPES or name in LEFT_OUT) or not _applies(element):
            return []
        style = self.styles.of(element, place.style)
        if is_gone(style):
            return []
        place = self._within(element, name, style, place)
        if marks and (label := _mark(element)) is not None:
            self._set(label, element, style, place)
            return []
        if name in LEFT_OUT:
            self._left_out(LEFT_OUT[name], marks)
            return []
        if any(style.tokens(key) for key in MARKERS):
            self._left_out("marker", marks)
        if style.tokens("filter"):
            self._left_out("filter", marks)
        opacity = style.opacity("opacity")
        place = replace(place, clip=self._clipped(element, style, place, depth))
        if name in SHAPES:
            painted: list[Piece | Group] = list(self._shape(name, element, style, place, depth))
        else:
            painted = [each for child, at in self._children(element, name, style, place)
                       for each in self.pieces(child, at, depth, marks)]  # fmt: skip
        if opacity == 0.0 or (place.clip is not None and place.clip.is_empty):
            return []
        return painted if opacity == 1.0 or not painted else [Group(opacity, painted)]

    def _left_out(self, what: str, counts: bool) -> None:
        if counts:
            self.found.left_out[what] = self.found.left_out.get(what, 0) + 1

    def _outlines(self, element: Element, style: Style, place: Place) -> list[Ring]:
        """Return the outlines of all shapes of an element, painted or not, in a frame that is its own already."""
        name = kind(element)
        if name in SHAPES:
            return rings_of(name, style, element, place.frame, place.whole)
        if name not in GROUPS:
            return []
        rings = []
        for child, at in self._children(element, name, style, place):
            inner = self.styles.of(child, at.style)
            if is_gone(inner):
                continue
            rings += self._outlines(child, inner, self._within(child, kind(child), inner, at))
        return rings

    def _within(self, element: Element, name: str, style: Style, place: Place) -> Place:
        own = names(element)
        frame = matrix(style.text("transform")) * place.frame if style.text("transform") else place.frame
        layers, ids = place.layers, (*place.ids, *own)
        if name in GROUPS:
            layers = (*layers, *own, *element.get("class", "").split())
            self.found.layers.update(layers)
        else:
            layers = (*layers, *element.get("class", "").split())
        self.found.ids.update(own)
        return replace(place, style=style, frame=frame, layers=layers, ids=ids)

    def _children(self, element: Element, name: str, style: Style, place: Place) -> Iterator[tuple[Element, Place]]:
        """Yield what stands within a group, and where."""
        if name == "use":
            target = self._named.get(link(element))
            if target is None:
                return
            x, y = (length(style.text(key), of) for key, of in zip("xy", place.whole, strict=True))
            moved = svgelements.Matrix.translate(x, y) * place.frame
            size = style.text("width"), style.text("height")
            at = replace(place, frame=moved, size=size)
            if kind(target) == "symbol":
                at = self._within(target, "g", self.styles.of(target, place.style), at)
                assert at.style is not None
                yield from ((child, inner) for inner in [self._viewport(target, at.style, at)] for child in target)
            else:
                yield target, at
            return
        if name == "svg":
            place = self._viewport(element, style, place)
        place = replace(place, size=("", ""))
        if name == "switch":
            yield from ((child, place) for child in [each for each in element if kind(each) and _applies(each)][:1])
        else:
            yield from ((child, place) for child in element)

    def _viewport(self, element: Element, style: Style, place: Place) -> Place:
        """Return the place inside a nested <svg> or a copied <symbol>."""
        across, down = place.whole
        width = length(place.size[0] or style.text("width") or "100%", across, across)
        height = length(place.size[1] or style.text("height") or "100%", down, down)
        x, y = length(style.text("x"), across), length(style.text("y"), down)
        box = view_box(element.get("viewBox"))
        frame, seen = view(box, width, height, element.get("preserveAspectRatio", ""), x, y)
        frame = frame * place.frame
        clip = place.clip
        overflow = [getattr(token, "lower_value", "") for token in style.tokens("overflow")]
        if seen is not None and overflow not in (["visible"], ["auto"]):
            clip = _both(clip, placed(seen, frame))
        return replace(place, frame=frame, whole=box[2:] if box else (width, height), clip=clip, size=("", ""))

    def _shape(self, name: str, element: Element, style: Style, place: Place, depth: int) -> Iterator[Piece]:
        if style.word("visibility") != "visible" or not self._options.shows(place.layers, place.ids):
            return
        rings = rings_of(name, style, element, place.frame, place.whole)
        self.found.count += sum(len(ring) - 1 for ring in rings)
        check_count(self.found.count)
        if not rings:
            return
        fill = self._paint(style, "fill", element, place, depth)
        stroke = self._paint(style, "stroke", element, place, depth)
        frame = place.frame
        pen = np.array([[frame.a, frame.b], [frame.c, frame.d]], dtype=float)
        pen = pen if style.word("vector-effect") == "none" else np.eye(2)
        width = style.inherited("stroke-width", lambda tokens: _width(tokens, place.whole), math.nan)
        filling, stroked = Piece(rings, fill, style.word("fill-rule"), clip=place.clip), None
        if width != 0.0:
            ends = style.word("stroke-linecap"), style.word("stroke-linejoin")
            stroked = Piece(rings, stroke, None, None if math.isnan(width) else width, *ends, pen, place.clip)
        first = [getattr(token, "lower_value", "") for token in style.inherited("paint-order", list, [])][:1]
        order = [stroked, filling] if first == ["stroke"] else [filling, stroked]
        yield from (each for each in order if each is not None and each.paint.alpha > 0.0)

    def _paint(self, style: Style, name: str, element: Element, place: Place, depth: int) -> Paint:
        paint = style.paint(name)
        if isinstance(paint, Server):
            paint = self._served(paint, element, place, depth)
        return paint.faded(style.opacity(f"{name}-opacity"))

    def _served(self, server: Server, element: Element, place: Place, depth: int) -> Paint:
        """Return the mean paint of a gradient or a pattern."""
        target = self._named.get(server.id)
        name = "" if target is None else kind(target)
        if target is None or name not in ("linearGradient", "radialGradient", "pattern") or depth > DEEPEST:
            self.styles.note(f"url(#{server.id})")
            return server.otherwise
        self.found.averaged += 1
        chain = self._chain(target)
        if name != "pattern":
            return self._gradient(next(([s for s in each if kind(s) == "stop"] for each in chain if len(each)), []))
        said: dict[str, str] = {}
        for each in reversed(chain):
            said.update(each.attrib)
        content = next((each for each in chain if any(kind(child) for child in each)), target)
        return self._pattern(content, said, element, place, depth)

    def _chain(self, target: Element) -> list[Element]:
        """Return a gradient or a pattern, and those that it takes after, in order."""
        chain = [target]
        while len(chain) < DEEPEST and (more := self._named.get(link(chain[-1]))) is not None and more not in chain:
            chain.append(more)
        return chain

    def _gradient(self, stops: list[Element]) -> Paint:
        paints: list[Paint] = []
        places: list[float] = []
        for stop in stops:
            style = self.styles.of(stop, None)
            paint = style.paint("stop-color")
            paints.append((paint if isinstance(paint, Paint) else NOTHING).faded(style.opacity("stop-opacity")))
            places.append(min(max(length(stop.get("offset", "0"), 1.0), 0.0, *places[-1:]), 1.0))
        if not paints:
            return NOTHING
        at = np.linspace(0.0, 1.0, 101)
        alpha = float(np.mean(np.interp(at, places, [each.alpha for each in paints])))
        return Paint(float(np.mean(np.interp(at, places, [each.lightness for each in paints]))), alpha)

    def _pattern(self, content: Element, said: dict[str, str], element: Element, place: Place, depth: int) -> Paint:
        box = view_box(said.get("viewBox"))
        of_box = said.get("patternUnits", "objectBoundingBox") == "objectBoundingBox"
        assert place.style is not None
        around = self._box(element, place.style, place) or (0.0, 0.0, 1.0, 1.0)
        wholes = (1.0, 1.0) if of_box else place.whole
        sizes = [length(said.get(key, "0"), of) for key, of in zip(("width", "height"), wholes, strict=True)]
        x, y = (length(said.get(key, "0"), of) for key, of in zip("xy", wholes, strict=True))
        if of_box and said.get("patternContentUnits") != "objectBoundingBox":
            sizes, x, y = [s * w for s, w in zip(sizes, around[2:], strict=True)], x * around[2], y * around[3]
        tile = box or (x if not of_box else 0.0, y if not of_box else 0.0, *sizes)
        if not min(sizes) > 0.0 or not min(tile[2:]) > 0.0:
            return NOTHING
        page = placed(tile, svgelements.Matrix())  # type: ignore[arg-type]
        inside = Place(self.styles.of(content, None), svgelements.Matrix(), place.whole, page)
        painted = leaves([p for child in content for p in self._plain(child, inside, depth + 1)])
        dark = overlaid(painted, lambda paint: paint.is_dark, lambda paint: paint.hides)
        light = overlaid(painted, lambda paint: paint.hides, lambda paint: paint.is_dark)
        share = (dark.area + light.area) / page.area
        shades = [each.paint for each in painted if each.paint.is_dark] or [Paint(0.0, 1.0)]
        shade = sum(each.lightness * each.alpha + 1 - each.alpha for each in shades) / len(shades)
        mean = (dark.area * shade + light.area) / (share * page.area) if share else 1.0
        return Paint(mean, min(share, 1.0))

    def _plain(self, element: Element, place: Place, depth: int) -> list[Piece | Group]:
        """Return what is painted of an element that serves another: all its layers, and no marks."""
        options, self._options = self._options, DrawingOptions()
        try:
            return self.pieces(element, place, depth, marks=False)
        finally:
            self._options = options

    def _box(self, element: Element, style: Style, place: Place) -> Box | None:
        """Return the box around an element in its own frame."""
        return bounds(self._outlines(element, style, replace(place, frame=svgelements.Matrix())))

    def _clipped(self, element: Element, style: Style, place: Place, depth: int) -> BaseGeometry | None:
        """Return what may be seen of an element, page frame; None for all of it."""
        clip = place.clip
        for name, kind_of, region in (("clip-path", "clipPath", self._clip), ("mask", "mask", self._mask)):
            tokens = style.tokens(name)
            if not tokens or getattr(tokens[0], "lower_value", "") in ("none", "initial", "inherit", "unset"):
                continue
            number = url_of(tokens[0])
            target = None if number is None else self._named.get(number)
            if target is None or kind(target) != kind_of or depth > DEEPEST:
                self.styles.note(f"{name} {serialize(tokens)}")
                continue
            clip = _both(clip, region(target, element, style, place, depth + 1))
        return clip

    def _clip(self, target: Element, element: Element, style: Style, place: Place, depth: int) -> BaseGeometry:
        own = self.styles.of(target, None)
        frame = self._unit_frame(target.get("clipPathUnits"), element, style, place)
        frame = matrix(own.text("transform")) * frame
        shown: list[BaseGeometry] = []
        for child in target:
            if kind(child) not in (*SHAPES, "use"):
                continue
            at = self._within(child, kind(child), self.styles.of(child, own), Place(own, frame, place.whole))
            assert at.style is not None
            if is_gone(at.style) or at.style.word("visibility") != "visible":
                continue
            rings = self._outlines(child, at.style, at)
            part = shapely.union_all(filled(rings, at.style.word("clip-rule") == "evenodd"))
            more = self._clipped(child, at.style, at, depth)
            shown.append(part if more is None else part.intersection(more))
        region = shapely.union_all(shown)
        more = self._clipped(target, own, replace(place, clip=None, frame=frame), depth)
        return region if more is None else region.intersection(more)

    def _mask(self, target: Element, element: Element, style: Style, place: Place, depth: int) -> BaseGeometry:
        own = self.styles.of(target, None)
        of_box = target.get("maskUnits", "objectBoundingBox") == "objectBoundingBox"
        wholes = (1.0, 1.0) if of_box else place.whole
        x, y = (length(target.get(key, "-10%"), of) for key, of in zip("xy", wholes, strict=True))
        size = [length(target.get(key, "120%"), of) for key, of in zip(("width", "height"), wholes, strict=True)]
        frame = self._unit_frame("objectBoundingBox" if of_box else None, element, style, place)
        page = placed((x, y, size[0], size[1]), frame)
        inside = Place(own, self._unit_frame(target.get("maskContentUnits"), element, style, place), place.whole, page)
        painted = leaves([each for child in target for each in self._plain(child, inside, depth)])
        if own.word("mask-type") == "alpha":
            return overlaid(painted, lambda paint: paint.alpha >= SHOWN, lambda paint: False)
        return overlaid(
            painted,
            lambda paint: paint.lightness * paint.alpha >= SHOWN,
            lambda paint: paint.lightness < SHOWN <= paint.alpha,
        )

    def _unit_frame(self, units: str | None, element: Element, style: Style, place: Place) -> Any:
        """Return the frame of what is measured in units of the page, or of the box around an element."""
        if units != "objectBoundingBox":
            return place.frame
        x, y, width, height = self._box(element, style, place) or (0.0, 0.0, 0.0, 0.0)
        return svgelements.Matrix(width, 0, 0, height, x, y) * place.frame

    def _set(self, label: str, element: Element, style: Style, place: Place) -> None:
        """Remember the middle of a mark."""
        rings = self._outlines(element, style, place)
        if kind(element) == "text":
            x, y = (length((style.text(key).split() or ["0"])[0], 0.0) for key in "xy")
            rings = [np.array([place.frame.point_in_matrix_space((x, y))], dtype=float)[:, :2]]
        if not rings:
            self.styles.note(f"the mark {label}, which has no shape")
            return
        points = np.concatenate(rings)
        middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
        turn = math.radians(float(element.get("data-heading-deg") or 0.0))
        self.found.marks[label] = (float(middle[0]), float(middle[1]), turn)


def is_gone(style: Style) -> bool:
    """Return whether an element and all within is not rendered at all."""
    return [getattr(token, "lower_value", "") for token in style.tokens("display")] == ["none"]


def overlaid(pieces: list[Piece], adds: Callable[[Paint], bool], removes: Callable[[Paint], bool]) -> BaseGeometry:
    """Return where the uppermost paint that adds or removes one adds."""
    shown: BaseGeometry = shapely.Polygon()
    for piece in pieces:
        if adds(piece.paint):
            shown = shown.union(piece.area())
        elif removes(piece.paint):
            shown = shown.difference(piece.area())
    return shown


def _both(one: BaseGeometry | None, other: BaseGeometry) -> BaseGeometry:
    return other if one is None else one.intersection(other)


def _width(tokens: list[Any], whole: tuple[float, float]) -> float | None:
    wide = length(serialize(tokens), math.hypot(*whole) / math.sqrt(2), math.nan)
    return wide if wide >= 0 else None


def _mark(element: Element) -> str | None:
    for name in names(element):
        if name.lower() == "start":
            return "start"
        if name.startswith("label-"):
            return name
    return None


def _applies(element: Element) -> bool:
    """Return whether the conditions of an element hold for a viewer in English."""
    languages = element.get("systemLanguage")
    if languages is not None and not any(each.strip().lower().startswith("en") for each in languages.split(",")):
        return False
    return not element.get("requiredExtensions", "").strip() and element.get("requiredExtensions") != ""
