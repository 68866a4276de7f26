"""Maps drawn as SVG, by hand or with a drawing program.

What a viewer shows as dark is wall: dark fills are solid, dark strokes are thin walls of 0.1 m, whatever their width.
What is light (lightness above 0.7 on white) takes away the walls that it is painted over, as a door does that is drawn
as a white line. Texts and pictures are decoration. A shape, a group or a copy with the id (or the label of a drawing
program) `start` marks the start by its middle, with an optional `data-heading-deg`; `label-NAME` marks a named point.

The scale is, in this order: what the caller says; the attribute `data-metres-per-unit` of the <svg> element; the
document size in mm, cm, in, pt, pc or Q, read as a drawing at 1:1; one metre per unit for drawings without physical
size that are at most 200 units wide. Anything else must state its scale. Inkscape users who draw on a paper page
add the attribute with the XML editor, 0.1 for a plan at 1:100 in mm. The file's y axis points down and is flipped:
the world's origin is the lower left corner of the view box.
"""

from dataclasses import replace
from xml.etree.ElementTree import Element

import numpy as np
import shapely
import svgelements
from shapely.geometry.base import BaseGeometry

from ...drawing import Drawing, WorldError, counted, shorten
from ...limits import check_labels, check_size
from ...options import AS_DRAWN, DrawingOptions
from ...text import name_of
from .document import parse
from .painting import Walls, walls_of
from .pieces import Group, Piece, leaves
from .place import Place
from .rendered import Renderer
from .scale import stated_scale, unitless_scale
from .shapes import Box, length, view, view_box

FLIP = np.diag([1.0, -1.0])
OPTIONS = ("scale", "layers", "ids", "without")


def read_svg(data: bytes, options: DrawingOptions = AS_DRAWN) -> Drawing:
    """Return the drawing in an SVG file's bytes; the scale is in metres per user unit and overrides the file's own."""
    options.check_only(OPTIONS, "an SVG file")
    root = parse(data)
    box = view_box(root.get("viewBox"))
    stated, said = stated_scale(root, box) if options.scale is None else (options.scale, "given")
    renderer = Renderer(root, options)
    pieces = _painted(renderer, root, box)
    options.check_names(renderer.found.layers, renderer.found.ids)
    dark = [piece for piece in leaves(pieces) if piece.paint.is_dark]
    notes = _notes(renderer, options)
    if not dark:
        raise _without_walls(notes)
    metres = stated if stated is not None else unitless_scale(dark)
    height = box[3] if box else 0.0
    page = _page(root, box)
    placed = _in_metres(pieces, metres, height)
    check_size(
        [shapely.LineString(ring) for piece in leaves(placed) if piece.paint.is_dark for ring in piece.rings], ()
    )
    whole = walls_of(placed)
    walls = whole if page is None else _on_page(placed, whole, _moved(page, metres, height))
    notes += _hidden(walls, whole)
    if not walls.lines and not walls.solids:
        raise _without_walls(notes)
    marks = renderer.found.marks
    points = {name: (x * metres, (height - y) * metres, heading) for name, (x, y, heading) in marks.items()}
    start = points.pop("start", None)
    check_labels(points)
    labels = {name_of(name.removeprefix("label-")): (x, y) for name, (x, y, _) in points.items()}
    words = (
        counted(walls.strokes, "line as a wall", "lines as walls"),
        counted(walls.fills, "shape as solid", "shapes as solid"),
    )
    return Drawing(
        tuple(walls.lines),
        tuple(walls.solids),
        None if start is None else np.array(start),
        labels,
        understood=", ".join(word for word in words if word),
        scale=f"{metres:.4g} m a unit, {said}",
        notes=tuple(notes),
    )


def _painted(renderer: Renderer, root: Element, box: Box | None) -> list[Piece | Group]:
    """Return what is painted in user units, y down, from the corner of the view box; raises WorldError."""
    whole = box[2:] if box else tuple(length(root.get(key, "100%"), 100.0, 100.0) for key in ("width", "height"))
    origin = svgelements.Matrix.translate(-box[0], -box[1]) if box else svgelements.Matrix()
    place = Place(None, origin, (whole[0], whole[1]))
    try:
        pieces = renderer.root(root, place)
    except WorldError:
        raise
    except Exception as error:
        # The parser raises whatever its innards meet; to the user all of it is one bad file.
        raise WorldError(
            f"expected SVG shapes, found one that cannot be read ({shorten(str(error))}): correct it"
        ) from None
    rings = [ring for piece in leaves(pieces) for ring in piece.rings]
    marks = list(renderer.found.marks.values())
    if not all(np.all(np.isfinite(ring)) for ring in rings) or not np.all(np.isfinite(marks)):
        raise WorldError("expected finite coordinates in the SVG file, found NaN or infinity: correct the drawing")
    return pieces


def _without_walls(notes: list[str]) -> WorldError:
    also = f" ({notes[0]})" if notes else ""
    return WorldError(f"expected dark lines or dark filled shapes in the SVG file, found none{also}: draw the walls")


def _notes(renderer: Renderer, options: DrawingOptions) -> list[str]:
    """Return in words what was left out and what was not understood."""
    found = renderer.found
    notes = []
    if renderer.styles.unknown:
        told = [shorten(what) for what in renderer.styles.unknown]
        more = f" and {len(told) - 3} more" if len(told) > 3 else ""
        notes.append(f"not understood, and ignored: {', '.join(told[:3])}{more}")
    if found.left_out:
        told = [counted(count, what, f"{what}s") for what, count in found.left_out.items()]
        notes.append(f"left out: {', '.join(told)}")
    if found.averaged:
        notes.append(f"{counted(found.averaged, 'gradient or pattern', 'gradients and patterns')} by the mean shade")
    layers = sorted(found.layers)
    if layers and not options.chooses:
        notes.append(f"layers and groups: {', '.join(map(shorten, layers[:8]))}{' ...' if len(layers) > 8 else ''}"
                     " (--layers, --ids and --without choose)")  # fmt: skip
    return notes


def _hidden(walls: Walls, whole: Walls) -> list[str]:
    """Return in words what cannot be seen; raises WorldError where most of the drawing lies beyond its page."""
    off = _extent(whole) - _extent(walls)
    if off > 0.5 * _extent(whole):
        raise WorldError(
            f"expected a drawing on its page, found {100 * off / _extent(whole):.0f} % of its walls outside the"
            " viewBox, where they are not visible: resize the page to its content"
        )
    hidden = counted(whole.hidden, "dark piece", "dark pieces")
    notes = [f"not visible (clipped, or covered by light shapes): {hidden}"] if hidden else []
    return notes + ([f"outside the page, where they are not visible: {off:.3g} m of walls"] if off > 0.05 else [])


def _extent(walls: Walls) -> float:
    return sum(line.length for line in walls.lines) + sum(solid.length for solid in walls.solids)


def _in_metres(pieces: list[Piece | Group], metres: float, height: float) -> list[Piece | Group]:
    """Return pieces in metres, y up."""
    placed: list[Piece | Group] = []
    for piece in pieces:
        if isinstance(piece, Group):
            placed.append(replace(piece, pieces=_in_metres(piece.pieces, metres, height)))
            continue
        rings = [np.round((ring * [1, -1] + [0, height]) * metres, 6) for ring in piece.rings]
        clip = None if piece.clip is None else _moved(piece.clip, metres, height)
        placed.append(replace(piece, rings=rings, clip=clip, pen=piece.pen @ FLIP * metres))
    return placed


def _moved(shape: BaseGeometry, metres: float, height: float) -> BaseGeometry:
    moved: BaseGeometry = shapely.transform(shape, lambda at: (at * [1, -1] + [0, height]) * metres)
    return moved


def _page(root: Element, box: Box | None) -> shapely.Polygon | None:
    """Return what a viewer shows, in user units from the corner of the view box; None where the file has no page."""
    width, height = (length(root.get(key, ""), 0.0, 0.0) for key in ("width", "height"))
    if not (width > 0 and height > 0):
        return None if box is None else shapely.box(0.0, 0.0, *box[2:])
    if box is None:
        return shapely.box(0.0, 0.0, width, height)
    _, seen = view(box, width, height, root.get("preserveAspectRatio", ""))
    assert seen is not None
    left, top = seen[0] - box[0], seen[1] - box[1]
    return shapely.box(left, top, left + seen[2], top + seen[3])


def _on_page(placed: list[Piece | Group], whole: Walls, page: BaseGeometry) -> Walls:
    """Return the walls on the page; a wall along its edge, of which half can be seen, is one of them."""
    ends = np.array([*whole.lines, *whole.solids], dtype=object)
    if page.covers(shapely.box(*shapely.total_bounds(ends))):
        return whole
    return walls_of(_clipped(placed, page))


def _clipped(pieces: list[Piece | Group], page: BaseGeometry) -> list[Piece | Group]:
    return [
        replace(each, pieces=_clipped(each.pieces, page)) if isinstance(each, Group)
        else replace(each, clip=page if each.clip is None else page.intersection(each.clip))
        for each in pieces
    ]  # fmt: skip
