"""The sheet as a CAD drawing in metres: walls, hatched poché, DIMENSION entities, and loose layers switched off."""

import io
from collections.abc import Collection, Iterable
from typing import Any

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry

from chainslam.viz.figures.plan_sheet import Sheet, scale_of

from ...artifacts.maps.dxf import DASHED, DIMENSIONS, LETTERS, NOTES, VERSION, WALLS, without_time

SOLID, OPENINGS, ROOMS = "WALLS-SOLID", "OPENINGS", "ROOMS"
LAYERS = {WALLS: (7, 35), SOLID: (8, 13), OPENINGS: (9, 13), ROOMS: (7, 13), DIMENSIONS: (5, 13), NOTES: (8, 13)}
"""Colour (in the CAD palette) and line width in 0.01 mm of each layer."""
LOOSE = (9, 13)
LETTER_MM, ROOM_MM, TICK_MM = 1.8, 2.5, 1.2
"""On paper."""


def sheet_dxf(sheet: Sheet, shown: Collection[str]) -> bytes:
    """Return the drawing of a sheet; layers of loose things that are not `shown` are off. Same input, same bytes.

    Its walls are lines on the layer WALLS, so that chainslam reads it as a world.
    """
    # Importing it takes longer than drawing, and most commands write no drawing.
    from ezdxf import units
    from ezdxf.enums import TextEntityAlignment
    from ezdxf.filemanagement import new

    mm = 1e-3 * scale_of(*sheet.bounds)
    with without_time():
        document = new(VERSION, units=units.M, setup=["dimstyles"])
        document.linetypes.add(DASHED, [0.3, 0.2, -0.1], description="opening")
        document.styles.add(LETTERS, font="arial.ttf")
        for name, (colour, width) in (LAYERS | {each.upper(): LOOSE for each in sheet.loose}).items():
            document.layers.add(
                name, color=colour, lineweight=width, linetype=DASHED if name == OPENINGS else "Continuous"
            )
        for name in set(sheet.loose) - set(shown):
            document.layers.get(name.upper()).off()
        space = document.modelspace()
        _hatch(space, sheet.both)
        _strokes(space, sheet.faces, WALLS)
        _strokes(space, sheet.openings, OPENINGS)
        for name, lines in sheet.loose.items():
            _strokes(space, lines, name.upper())
        for line in sheet.lines:
            space.add_aligned_dim(
                p1=line.ends[0].tolist(), p2=line.ends[1].tolist(), distance=line.offset_m, text=line.words,
                dxfattribs={"layer": DIMENSIONS},
                override={
                    "dimtxt": LETTER_MM * mm, "dimtsz": TICK_MM * mm, "dimexo": mm, "dimexe": mm, "dimgap": 0.6 * mm,
                    "dimtxsty": LETTERS, "dimclrd": 256, "dimclre": 256, "dimclrt": 256, "dimtad": 1,
                },
            ).render()  # fmt: skip
        for at, words in sheet.rooms:
            for row, each in enumerate(words.split("\n")):
                text = space.add_text(each, height=ROOM_MM * mm, dxfattribs={"layer": ROOMS, "style": LETTERS})
                place = at - [0.0, 1.5 * ROOM_MM * mm * row]
                text.set_placement(place.tolist(), align=TextEntityAlignment.MIDDLE_CENTER)
        low, high = sheet.bounds
        for row, each in enumerate((sheet.title, *sheet.notes)):
            plain = "".join(letter if letter.isprintable() else " " for letter in each)
            text = space.add_text(plain, height=ROOM_MM * mm, dxfattribs={"layer": NOTES, "style": LETTERS})
            text.set_placement((low - [0.0, (8.0 + 4.0 * row) * mm]).tolist())
        document.set_modelspace_vport(1.2 * float((high - low).max()), (0.5 * (low + high)).tolist())
        stream = io.StringIO()
        document.write(stream)
    return document.encode(stream.getvalue())


def _strokes(space: Any, lines: Iterable[Float[np.ndarray, "2 2"]], layer: str) -> None:
    for line in lines:
        space.add_line(line[0].tolist(), line[1].tolist(), dxfattribs={"layer": layer})


def _hatch(space: Any, shape: BaseGeometry) -> None:
    for part in shapely.get_parts(shape):
        if isinstance(part, shapely.Polygon) and not part.is_empty:
            hatch = space.add_hatch(color=256, dxfattribs={"layer": SOLID})
            for ring in (part.exterior, *part.interiors):
                hatch.paths.add_polyline_path(shapely.get_coordinates(ring)[:-1].tolist(), is_closed=True)
