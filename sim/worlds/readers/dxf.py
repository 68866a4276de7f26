"""DXF, read by ezdxf: lines, polylines, arcs, circles and curves of the model space are walls.

Blocks are read where they are inserted. Layers that are off or frozen are skipped, and so are hatches, texts and
dimensions. A circle, a point or a block on a layer `START` (or a block of that name) marks the start. The scale is the
file's own unit ($INSUNITS); a file without one is in metres if that gives the size of a building. From a file written
by chainslam only the walls and the start are read.
"""

import io
import logging
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import ezdxf
import ezdxf.path
import numpy as np
import shapely
from ezdxf import recover, units
from ezdxf.enums import InsertUnits
from jaxtyping import Float

from ..drawing import Drawing, WorldError, counted, shorten
from ..limits import check_count, check_size
from ..options import AS_DRAWN, DrawingOptions
from .files import read_bytes

# The library tells each fault that it mends to whoever listens; what cannot be mended is told below.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())
LINES = ("LINE", "LWPOLYLINE", "POLYLINE", "ARC", "CIRCLE", "ELLIPSE", "SPLINE")
FACES = ("SOLID", "TRACE", "3DFACE")
ENTITIES_MAX = 200_000
DEEPEST = 20
STRAIGHT_M = 0.01
"""Curves are chords that deviate less than this."""
UNITLESS_M = 1.0, 200.0
START = "START"
OWN_STYLE, OWN_WALLS, OWN_WAY = "CHAINSLAM", "WALLS", "PATH"
"""Of the drawings that this program writes: the style of their letters, and the layers of walls and of the start."""


@dataclass
class _Found:
    paths: list[Float[np.ndarray, "_ 2"]] = field(default_factory=list)
    faces: list[Float[np.ndarray, "_ 2"]] = field(default_factory=list)
    start: tuple[float, float] | None = None
    layers: set[str] = field(default_factory=set)
    blocks: set[str] = field(default_factory=set)
    left_out: Counter[str] = field(default_factory=Counter)
    read: int = 0


def read_dxf(path: Path, options: DrawingOptions = AS_DRAWN) -> Drawing:
    """Return the drawing in a DXF file; raises WorldError, in one line, for any other file."""
    options.check_only(("scale", "layers", "ids", "without"), "a DXF file")
    document, mended = _document(read_bytes(path))
    metres, said = _unit(document) if options.scale is None else (options.scale, "given")
    is_own = OWN_STYLE in document.styles and not options.chooses
    found = _Found()
    try:
        for entity, layer, blocks in _entities(document, document.modelspace(), "0", (), found):
            _take(entity, layer, blocks, found, options, metres or STRAIGHT_M, is_own)
    except WorldError:
        raise
    except Exception as error:
        raise _broken(error) from None
    options.check_names(found.layers, found.blocks)
    if not found.paths and not found.faces:
        raise WorldError(f"expected lines or polylines in the DXF file, found none{_left_out(found)}: draw the walls")
    if metres is None:
        metres = _unitless([*found.paths, *found.faces])
    lines = [shapely.LineString(np.round(points * metres, 6)) for points in found.paths]
    solids = [shapely.Polygon(np.round(points * metres, 6)) for points in found.faces]
    check_size(lines, solids)
    start = None if found.start is None else np.array([found.start[0] * metres, found.start[1] * metres, 0.0])
    words = (
        counted(len(lines), "line as a wall", "lines as walls"),
        counted(len(solids), "face as solid", "faces as solid"),
    )
    notes = mended + ([f"left out{_left_out(found)}"] if found.left_out else [])
    if not options.chooses and not is_own:
        names = sorted(found.layers)
        notes.append(f"layers: {', '.join(map(shorten, names[:8]))}{' ...' if len(names) > 8 else ''}"
                     " (--layers and --without choose)")  # fmt: skip
    return Drawing(
        tuple(lines), tuple(solids), start, understood=", ".join(filter(None, words)),
        scale=f"{metres:.4g} m a unit, {said}", notes=tuple(notes),
    )  # fmt: skip


def _document(data: bytes) -> tuple[Any, list[str]]:
    """Return a file and what was mended in it, in words."""
    if data.startswith(b"AutoCAD Binary DXF"):
        raise WorldError("expected a DXF file of text, found a binary one: save it as ASCII DXF")
    try:
        document, found = recover.read(io.BytesIO(data))
    except Exception as error:
        # The library raises whatever a broken file makes it meet; to the user all of it is one bad file.
        raise _broken(error) from None
    faults = len(found.errors) + len(found.fixes)
    return document, ([f"repaired: {counted(faults, 'fault', 'faults')} of the file"] if faults else [])


def _broken(error: Exception) -> WorldError:
    return WorldError(f"expected a DXF file, found a broken one ({shorten(str(error))}): save it again")


def _unit(document: Any) -> tuple[float | None, str]:
    number = int(document.header.get("$INSUNITS", 0) or 0)
    if number == 0:
        return None, "assumed, since the file names no unit (--scale METRES says another)"
    try:
        metres = float(units.conversion_factor(InsertUnits(number), InsertUnits.Meters))
    except (ValueError, TypeError, KeyError):
        metres = 0.0
    if not 0 < metres < np.inf:
        raise WorldError(f"expected a unit of length in $INSUNITS, found {number}: state it, --scale METRES")
    return metres, "as the file says"


def _unitless(paths: list[Float[np.ndarray, "_ 2"]]) -> float:
    extent = float(np.max(np.ptp(np.concatenate(paths), axis=0)))
    if not UNITLESS_M[0] <= extent <= UNITLESS_M[1]:
        metres = 0.01 if extent < 5e3 else 0.001
        raise WorldError(
            f"expected a DXF file that names its unit ($INSUNITS), found none and {extent:.4g} units: state it, such as"
            f" --scale {metres:g}"
        )
    return 1.0


def _entities(
    document: Any, entities: Any, above: str, blocks: tuple[str, ...], found: _Found
) -> Iterator[tuple[Any, str, tuple[str, ...]]]:
    """Yield what is drawn, with its layer and the blocks around it."""
    for entity in entities:
        found.read += 1
        if found.read > ENTITIES_MAX:
            raise WorldError(
                f"expected at most {ENTITIES_MAX} shapes, found more, counting blocks: simplify the drawing"
            )
        own = str(entity.dxf.get("layer", "0"))
        layer = above if own == "0" and blocks else own
        if entity.dxf.get("invisible", 0) or not _is_on(document, layer):
            continue
        if entity.dxftype() != "INSERT":
            yield entity, layer, blocks
            continue
        name = str(entity.dxf.get("name", ""))
        if name.upper() == START or layer.upper() == START:
            at = entity.dxf.insert
            found.start = float(at.x), float(at.y)
            continue
        if len(blocks) == DEEPEST or name in blocks:
            raise WorldError(f"expected blocks at most {DEEPEST} deep, found {shorten(name)} deeper: explode it")
        for copy in entity.multi_insert() if entity.mcount > 1 else [entity]:
            yield from _entities(document, copy.virtual_entities(), layer, (*blocks, name), found)


def _is_on(document: Any, layer: str) -> bool:
    if layer not in document.layers:
        return True
    entry = document.layers.get(layer)
    return not entry.is_off() and not entry.is_frozen()


def _take(
    entity: Any,
    layer: str,
    blocks: tuple[str, ...],
    found: _Found,
    options: DrawingOptions,
    metres: float,
    is_own: bool,
) -> None:
    kind = entity.dxftype()
    marks = OWN_WAY if is_own else START
    if layer.upper() == marks and kind in ("CIRCLE", "POINT"):
        at = entity.dxf.center if kind == "CIRCLE" else entity.dxf.location
        found.start = float(at.x), float(at.y)
        return
    found.layers.add(layer)
    found.blocks.update(blocks)
    if not options.shows((layer,), blocks) or (is_own and layer != OWN_WALLS):
        return
    if kind in FACES:
        corners = [(float(at.x), float(at.y)) for at in entity.wcs_vertices()]
        found.faces += [np.array(corners)] if len(corners) > 2 else []
    elif kind not in LINES or (kind == "POLYLINE" and not (entity.is_2d_polyline or entity.is_3d_polyline)):
        found.left_out[kind] += 1
    else:
        points = np.array([(at.x, at.y) for at in ezdxf.path.make_path(entity).flattening(STRAIGHT_M / metres, 4)])
        if len(points) > 1 and np.ptp(points, axis=0).any():
            found.paths.append(points)
            check_count(sum(len(path) - 1 for path in found.paths[-1:]))


def _left_out(found: _Found) -> str:
    told = ", ".join(f"{count} {kind}" for kind, count in sorted(found.left_out.items()))
    return f": {told}" if told else ""
