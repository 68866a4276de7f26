"""A drawing in SVG that stands inside a page: only shapes and words of it are let through."""

from dataclasses import dataclass
from xml.etree.ElementTree import Element, ParseError, SubElement, tostring

import defusedxml.ElementTree
from defusedxml.common import DefusedXmlException
from markupsafe import Markup

SHAPES = ("g", "path", "line", "circle", "text", "title", "desc")
ATTRIBUTES = (
    *("d", "x", "y", "x1", "y1", "x2", "y2", "cx", "cy", "r", "transform", "fill", "fill-rule", "stroke"),
    *("stroke-width", "text-anchor", "dominant-baseline", "font-size", "font-family", "font-weight"),
)
"""Of shapes; none of them can name a file, an address or a program."""


@dataclass(frozen=True)
class PageDrawing:
    """A drawing as wide as the page, in which a reader can zoom, with what it shows in words."""

    svg: Markup
    caption: str


def drawing(data: bytes, caption: str) -> PageDrawing | None:
    """Return what a page can show of an SVG file; None for another file, or one nested too deep."""
    try:
        root = defusedxml.ElementTree.fromstring(data)
    except (ParseError, DefusedXmlException, ValueError):
        return None
    if _name(root) != "svg" or not root.get("viewBox"):
        return None
    clean = Element("svg", xmlns="http://www.w3.org/2000/svg", viewBox=root.attrib["viewBox"], role="img")
    try:
        _copy(root, clean)
        shown = tostring(clean, encoding="unicode")
    except RecursionError:
        return None
    return PageDrawing(Markup(shown), caption)


def _copy(source: Element, target: Element) -> None:
    for child in source:
        if _name(child) in SHAPES:
            kept = {key: value for key, value in child.attrib.items() if key in ATTRIBUTES and "url(" not in value}
            copied = SubElement(target, _name(child), kept)
            copied.text = (child.text or "").strip() or None
            _copy(child, copied)


def _name(element: Element) -> str:
    return str(element.tag).rpartition("}")[2]
