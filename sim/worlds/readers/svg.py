"""Maps drawn as SVG, by hand or with a drawing program.

What looks like a wall is a wall. Dark closed shapes with a dark fill are solid; every other dark stroke is a thin
wall of 0.1 m, whatever its stroke width. Light or invisible strokes and fills (lightness above 0.7), texts and images
are decoration. A shape with the id (or Inkscape label) `start` marks the start by its middle, with an optional
`data-heading-deg`; `label-NAME` marks a named point.

The scale is, in this order: what the caller says; the attribute `data-metres-per-unit` of the <svg> element; the
document size in mm, cm, in, pt, pc or Q, read as a drawing at 1:1; one metre per unit for drawings without physical
size that are at most 200 units wide. Anything else must state its scale. Inkscape users who draw on a paper page
add the attribute with the XML editor, 0.1 for a plan at 1:100 in mm. The file's y axis points down and is flipped:
the world's origin is the lower left corner of the view box.
"""

import io
import math
from typing import Any
from xml.etree.ElementTree import Element, tostring

import defusedxml.ElementTree
import numpy as np
import shapely
import svgelements
from defusedxml.common import DefusedXmlException

from ..drawing import LARGEST_M, SMALLEST_M, Drawing, WorldError, counted, shorten
from ..limits import check_count, check_labels, check_size
from ..text import name_of
from .winding import filled

DARK = 0.7
CURVE_STEPS = 24
SHAPES = 200_000
WORDS_MAX = 10_000
"""Characters of an attribute (not of a path) or a <style>."""
UNITLESS_MAX = 200.0
PHYSICAL = {"mm": 0.001, "cm": 0.01, "in": 0.0254, "pt": 0.0254 / 72, "pc": 0.0254 / 6, "Q": 0.00025}
PIXEL_M = 0.0254 / 96
XLINK = "{http://www.w3.org/1999/xlink}href"
INKSCAPE_LABEL = "{http://www.inkscape.org/namespaces/inkscape}label"


def read_svg(data: bytes, scale: float | None = None) -> Drawing:
    """Return the drawing in an SVG file's bytes; `scale` in metres per user unit overrides the file's own."""
    root = _parse(data)
    box = _view_box(root)
    stated, said = _stated_scale(root, box) if scale is None else (scale, "given")
    shapes, marks = _shapes(root, box)
    if not shapes:
        raise WorldError("expected dark lines or dark filled shapes in the SVG file, found none: draw the walls")
    metres = stated if stated is not None else _unitless_scale(shapes)
    height = box[3] if box else 0.0
    lines: list[shapely.LineString] = []
    solids: list[shapely.Polygon] = []
    drawn = [([np.round((ring * [1, -1] + [0, height]) * metres, 6) for ring in rings], rule) for rings, rule in shapes]
    check_size([shapely.LineString(ring) for rings, _ in drawn for ring in rings], ())
    for rings, rule in drawn:
        if rule is None:
            lines += [shapely.LineString(ring) for ring in rings]
        else:
            solids += filled(rings, even_odd=rule == "evenodd")
    points = {name: (x * metres, (height - y) * metres, heading) for name, (x, y, heading) in marks.items()}
    start = points.pop("start", None)
    check_labels(points)
    labels = {name_of(name.removeprefix("label-")): (x, y) for name, (x, y, _) in points.items()}
    fills = sum(rule is not None for _, rule in drawn)
    words = counted(len(lines), "line as a wall", "lines as walls"), counted(fills, "shape as solid", "shapes as solid")
    return Drawing(
        tuple(lines),
        tuple(solids),
        None if start is None else np.array(start),
        labels,
        understood=", ".join(word for word in words if word),
        scale=f"{metres:.4g} m a unit, {said}",
    )


def _parse(data: bytes) -> Element:
    """Return the root element; raise WorldError for entity tricks and for what is not SVG."""
    try:
        root = defusedxml.ElementTree.fromstring(data)
    except DefusedXmlException:
        raise WorldError("expected an SVG file without entity declarations, found some: save it as plain SVG") from None
    except Exception as error:
        raise WorldError(f"expected an SVG file, found broken XML ({shorten(str(error))}): save it again") from None
    if root.tag.rpartition("}")[2] != "svg":
        raise WorldError(f"expected an <svg> element, found <{shorten(root.tag)}>: choose an SVG file")
    _check_words(root)
    if _copies(root) > SHAPES:
        raise WorldError(f"expected at most {SHAPES} shapes, found more, counting <use> copies: simplify the drawing")
    return root


def _check_words(root: Element) -> None:
    """Raise WorldError for attributes and styles on which the parser would work for minutes."""
    for element in root.iter():
        # Paths are read in one pass, embedded pictures and a program's own attributes not at all.
        words = [t for key, t in element.items() if key not in ("d", "points") and key[0] != "{" and t[:5] != "data:"]
        words += [element.text or ""] if str(element.tag).endswith("style") else []
        longest = max((len(text) for text in words), default=0)
        if longest > WORDS_MAX:
            raise WorldError(
                f"expected at most {WORDS_MAX} characters in an attribute or <style>, found {longest}: simplify it"
            )


def _copies(root: Element) -> int:
    """Return how many elements there are once every <use> is replaced by what it names; huge for endless loops."""
    named = {element.get("id"): element for element in root.iter() if element.get("id")}
    known: dict[int, int] = {}

    def count(element: Element, depth: int) -> int:
        if id(element) not in known:
            known[id(element)] = SHAPES + 1
            total = 1 + sum(count(child, depth + 1) for child in element) if depth < 200 else SHAPES + 1
            link = element.get("href") or element.get(XLINK) or ""
            target = named.get(link.removeprefix("#"))
            if str(element.tag).endswith("use") and target is not None:
                total += count(target, depth + 1)
            known[id(element)] = total
        return known[id(element)]

    return count(root, 0)


def _view_box(root: Element) -> tuple[float, float, float, float] | None:
    text = root.get("viewBox")
    if text is None:
        return None
    try:
        x, y, width, height = (float(part) for part in text.replace(",", " ").split())
    except ValueError:
        x = y = width = height = math.nan
    if not (math.isfinite(x) and math.isfinite(y) and 0 < width < math.inf and 0 < height < math.inf):
        raise WorldError(f'expected viewBox="x y width height", found {shorten(text)}: correct the <svg> element')
    return x, y, width, height


def _stated_scale(root: Element, box: tuple[float, float, float, float] | None) -> tuple[float | None, str]:
    """Return metres per user unit where the file states it, and in words who says so."""
    text = root.get("data-metres-per-unit")
    if text is not None:
        try:
            value = float(text)
        except ValueError:
            value = math.nan
        if not 0 < value < math.inf:
            raise WorldError(f"expected data-metres-per-unit above 0, found {shorten(text)}: correct the <svg> element")
        return value, "as the file says"
    sizes = []
    for key, i in (("width", 2), ("height", 3)):
        length = (root.get(key) or "").strip()
        if length.endswith(tuple(PHYSICAL)):
            try:
                metres = float(length.rstrip("mcinptQ")) * next(v for k, v in PHYSICAL.items() if length.endswith(k))
            except ValueError:
                raise WorldError(
                    f"expected {key} as a length such as 900cm, found {shorten(length)}: correct it"
                ) from None
            sizes.append(metres / box[i] if box else PIXEL_M)
    if sizes and math.isfinite(min(sizes)) and min(sizes) > 0:
        return min(sizes), "by the size of the page, drawn 1:1 (--scale METRES says another)"
    return None, "assumed (--scale METRES says another)"


def _unitless_scale(shapes: list[tuple[list[Any], str | None]]) -> float:
    points = np.concatenate([ring for rings, _ in shapes for ring in rings])
    extent = float(np.max(np.ptp(points, axis=0)))
    if not SMALLEST_M <= extent <= min(UNITLESS_MAX, LARGEST_M):
        metres = 0.01 if extent < 1e4 else 0.001
        raise WorldError(
            f"expected a drawing in metres, found {extent:.4g} units wide without a physical size: state the scale,"
            f' such as --scale {metres:g}, or data-metres-per-unit="{metres:g}" in the <svg> element'
        )
    return 1.0


def _shapes(
    root: Element, box: tuple[float, float, float, float] | None
) -> tuple[list[tuple[list[Any], str | None]], dict[str, tuple[float, float, float]]]:
    """Return dark shapes as (rings in user units, fill rule or None for lines), and the marked points."""
    for key in ("width", "height", "preserveAspectRatio"):
        root.attrib.pop(key, None)
    if box:
        root.set("width", repr(box[2]))
        root.set("height", repr(box[3]))
    shapes: list[tuple[list[Any], str | None]] = []
    marks: dict[str, tuple[float, float, float]] = {}
    pieces = 0
    try:
        for element in svgelements.SVG.parse(io.BytesIO(tostring(root))).elements():
            if isinstance(element, svgelements.Shape):
                rings = [ring for ring in _rings(element) if len(ring) > 1]
                pieces += sum(len(ring) - 1 for ring in rings)
                check_count(pieces)
                name = _mark(element)
                if name is None:
                    shapes += _visible(element, rings)
                elif rings:
                    points = np.concatenate(rings)
                    middle = 0.5 * (points.min(axis=0) + points.max(axis=0))
                    turn = float(element.values.get("data-heading-deg") or 0.0)
                    marks[name] = (float(middle[0]), float(middle[1]), math.radians(turn))
    except WorldError:
        raise
    except Exception as error:
        # The parser raises whatever its innards meet; to the user all of it is one bad file.
        raise WorldError(
            f"expected SVG shapes, found one that cannot be read ({shorten(str(error))}): correct it"
        ) from None
    if not all(np.all(np.isfinite(ring)) for rings, _ in shapes for ring in rings) or not np.all(
        np.isfinite(list(marks.values()))
    ):
        raise WorldError("expected finite coordinates in the SVG file, found NaN or infinity: correct the drawing")
    return shapes, marks


def _mark(element: Any) -> str | None:
    names = (element.id, element.values.get(INKSCAPE_LABEL))
    return next((str(n) for n in names if n is not None and (n == "start" or str(n).startswith("label-"))), None)


def _visible(element: Any, rings: list[Any]) -> list[tuple[list[Any], str | None]]:
    if element.values.get("visibility") in ("hidden", "collapse") or not rings:
        return []
    closed = [ring for ring in rings if np.allclose(ring[0], ring[-1]) and len(ring) > 3]
    solid, stroke = _is_dark(element.fill, True), _is_dark(element.stroke, False)
    rule = "evenodd" if element.values.get("fill-rule") == "evenodd" else "nonzero"
    if solid and not stroke:
        return [(rings, rule)]
    if not stroke:
        return []
    if not solid:
        return [(rings, None)]
    ids = {id(ring) for ring in closed}
    parts = [(closed, rule), ([ring for ring in rings if id(ring) not in ids], None)]
    return [part for part in parts if part[0]]


def _is_dark(color: Any, unknown: bool) -> bool:
    """Return whether paint reads as drawn: dark on a white page, transparency included."""
    if color is None:
        return unknown
    if color.value is None:
        return False
    lightness = (0.299 * color.red + 0.587 * color.green + 0.114 * color.blue) / 255
    alpha = 1.0 if color.alpha is None else color.alpha / 255
    return bool(lightness * alpha + 1 - alpha < DARK)


def _rings(shape: Any) -> list[Any]:
    """Return the subpaths of a shape as points in user units, curves as short chords."""
    path = svgelements.Path(shape)
    path.reify()
    rings: list[list[list[float]]] = []
    for piece in path:
        if isinstance(piece, svgelements.Move) or not rings:
            rings.append([] if piece.end is None else [[piece.end.x, piece.end.y]])
            if isinstance(piece, svgelements.Move):
                continue
        if isinstance(piece, svgelements.Line | svgelements.Close):
            rings[-1] += [[piece.end.x, piece.end.y]] if piece.end is not None else []
        else:
            rings[-1] += piece.npoint(np.linspace(0, 1, CURVE_STEPS + 1)[1:]).tolist()
        if isinstance(piece, svgelements.Close) and piece.end is not None:
            rings.append([[piece.end.x, piece.end.y]])
    return [np.array(ring) for ring in rings if ring]
