"""What of a document is rendered, and where: groups, copies, viewports, clips and masks resolved to pieces of paint."""

import math
from collections.abc import Iterator
from dataclasses import replace
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import svgelements
from tinycss2 import serialize

from ...limits import check_count
from ...options import DrawingOptions
from .cascade import Style, Styles
from .clipping import seen_of
from .document import kind, link, names
from .paint import Paint, Server
from .pieces import Group, Piece
from .place import Found, Place, both, is_gone
from .servers import mean_paint
from .shapes import SHAPES, Ring, length, matrix, placed, rings_of, view, view_box

GROUPS = ("g", "a", "svg", "switch", "use")
LEFT_OUT = {"text": "text", "image": "picture", "foreignObject": "foreign object"}
"""Elements that are to be seen, and that are no walls."""
MARKERS = ("marker", "marker-start", "marker-mid", "marker-end")


class Renderer:
    """Walks through a document as a viewer does."""

    def __init__(self, root: Element, options: DrawingOptions) -> None:
        self.found, self.styles, self._options = Found(), Styles(root), options
        self.named: dict[str, Element] = {}
        for element in root.iter():
            if number := element.get("id"):
                self.named.setdefault(number, element)

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
        place = self.within(element, name, style, place)
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
        place = replace(place, clip=seen_of(self, element, style, place, depth))
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

    def outlines(self, element: Element, style: Style, place: Place) -> list[Ring]:
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
            rings += self.outlines(child, inner, self.within(child, kind(child), inner, at))
        return rings

    def within(self, element: Element, name: str, style: Style, place: Place) -> Place:
        """Return the place that an element makes for what is within it."""
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
            target = self.named.get(link(element))
            if target is None:
                return
            x, y = (length(style.text(key), of) for key, of in zip("xy", place.whole, strict=True))
            moved = svgelements.Matrix.translate(x, y) * place.frame
            size = style.text("width"), style.text("height")
            at = replace(place, frame=moved, size=size)
            if kind(target) == "symbol":
                at = self.within(target, "g", self.styles.of(target, place.style), at)
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
            clip = both(clip, placed(seen, frame))
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
            paint = mean_paint(self, paint, element, place, depth)
        return paint.faded(style.opacity(f"{name}-opacity"))

    def plain(self, element: Element, place: Place, depth: int) -> list[Piece | Group]:
        """Return what is painted of an element that serves another: all its layers, and no marks."""
        options, self._options = self._options, DrawingOptions()
        try:
            return self.pieces(element, place, depth, marks=False)
        finally:
            self._options = options

    def _set(self, label: str, element: Element, style: Style, place: Place) -> None:
        """Remember the middle of a mark."""
        rings = self.outlines(element, style, place)
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
