"""The map as a CAD drawing, `map.dxf`: the walls of `map.geojson` on layers, in metres, in the frame of the map."""

import logging
import threading
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from io import StringIO
from typing import Any

import ezdxf
import numpy as np
from ezdxf import units
from ezdxf.document import Drawing
from ezdxf.enums import TextEntityAlignment
from ezdxf.layouts import Modelspace
from jaxtyping import Float

from viz.figures.floor_plan import Dimension

VERSION = "R2000"
"""The oldest format that states its unit: all that read DXF read it."""
WALLS, TENTATIVE, DIMENSIONS, PATH = "WALLS", "WALLS-TENTATIVE", "DIMENSIONS", "PATH"
OPEN_ENDS, NOTES = "OPEN-ENDS", "NOTES"
LAYERS = {WALLS: (7, 35), TENTATIVE: (8, 18), DIMENSIONS: (5, 13), PATH: (3, 13), OPEN_ENDS: (1, 18), NOTES: (8, 13)}
"""Of each layer the colour, by AutoCAD's index, and the breadth of its lines on paper, in 0.01 mm."""
DASHED = "CHAINSLAM-DASHED"
DASHES_M = [0.3, 0.2, -0.1]
"""Length of the pattern, the dash and the gap."""
LETTERS, FONT = "CHAINSLAM", "arial.ttf"
CAPITALS = 0.72
"""Height of a capital, which a drawing states, as a share of the letters' height, which the floor plan states."""
RING_M, START_M, NOTE_M = 0.2, 0.12, 0.2
"""Radius of the rings around open ends and around the start, and height of the letters of a note."""

_fixed = threading.Lock()
# A home without room for its cache of fonts is told on standard error; no letter is measured here.
logging.getLogger("ezdxf").addHandler(logging.NullHandler())


def map_dxf(features: Iterable[Mapping[str, Any]], dimensions: Sequence[Dimension], title: str) -> bytes:
    """Return the drawing of the features of `map_geojson`, world frame, m, with lengths and areas beside them.

    A chain is a polyline on the layer WALLS, closed where the chain is; each tentative wall is a line on a layer of
    its own. A shape with a coordinate that is not finite is left out. The same input gives the same bytes.
    """
    with _same_bytes():
        drawing = ezdxf.new(VERSION, units=units.M)
        drawing.linetypes.add(DASHED, DASHES_M, description="not seen well enough yet")
        drawing.styles.add(LETTERS, font=FONT)
        for name, (colour, breadth) in LAYERS.items():
            linetype = DASHED if name == TENTATIVE else "Continuous"
            drawing.layers.add(name, color=colour, lineweight=breadth, linetype=linetype)
        plan = _Plan(drawing.modelspace())
        for feature in features:
            plan.feature(feature)
        for dimension in dimensions:
            plan.dimension(dimension)
        low, high = plan.bounds
        words = [title, *(["lengths in m, areas in m², with 95 % intervals"] if dimensions else [])]
        for line, each in enumerate(words):
            plan.note(each, low - [0.0, (2.0 + 1.6 * line) * NOTE_M])
        _show(drawing, low, high)
        stream = StringIO()
        drawing.write(stream)
        return drawing.encode(stream.getvalue())


@contextmanager
def _same_bytes() -> Iterator[None]:
    """Let ezdxf write constants where it writes the time, its version and random ids."""
    with _fixed:
        before = ezdxf.options.write_fixed_meta_data_for_testing
        ezdxf.options.write_fixed_meta_data_for_testing = True
        try:
            yield
        finally:
            ezdxf.options.write_fixed_meta_data_for_testing = before


def _show(drawing: Drawing, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"]) -> None:
    """State how far the drawing reaches, and let a program open it with all of it in sight."""
    drawing.modelspace().reset_extents((*low.tolist(), 0.0), (*high.tolist(), 0.0))
    middle, size = (low + high) / 2, high - low
    drawing.set_modelspace_vport(1.2 * max(float(size.max()), 1.0), (float(middle[0]), float(middle[1])))


class _Plan:
    """Puts shapes into a drawing, and keeps how far they reach."""

    def __init__(self, space: Modelspace) -> None:
        self._space = space
        self._corners: list[Float[np.ndarray, "_ 2"]] = []

    @property
    def bounds(self) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
        """The lower left and the upper right corner around all shapes, m; zeros where there are none."""
        points = np.concatenate(self._corners) if self._corners else np.zeros((1, 2))
        return points.min(axis=0), points.max(axis=0)

    def feature(self, feature: Mapping[str, Any]) -> None:
        """Draw a feature of `map.geojson`, of the kinds that a floor plan has."""
        properties, coordinates = feature["properties"], feature["geometry"]["coordinates"]
        match properties["kind"]:
            case "chain" if properties["closed"]:
                self._way(coordinates[0][:-1], WALLS, closed=True)
            case "chain":
                self._way(coordinates, WALLS)
            case "wall" if properties["tentative"]:
                self._way(coordinates, TENTATIVE)
            case "trajectory":
                self._way(coordinates, PATH)
            case "start":
                self._ring(coordinates, START_M, PATH)
            case "open-end":
                self._ring(coordinates, RING_M, OPEN_ENDS)

    def dimension(self, told: Dimension) -> None:
        """Write a length beside its wall, or an area into its room, as the floor plan does."""
        if told.letters_m is not None:
            self._text(told.words, told.beside_world, CAPITALS * told.letters_m, -told.clockwise_deg, DIMENSIONS)

    def note(self, words: str, corner_world: Float[np.ndarray, "2"]) -> None:
        """Write a line of words that begins at a place."""
        self._text(words, corner_world, NOTE_M, 0.0, NOTES, TextEntityAlignment.LEFT)

    def _way(self, points_world: Any, layer: str, closed: bool = False) -> None:
        points = self._placed(points_world)
        if points is None:
            return
        if len(points) == 2 and not closed:
            self._space.add_line(points[0].tolist(), points[1].tolist(), dxfattribs={"layer": layer})
            return
        self._space.add_lwpolyline(points.tolist(), close=closed, dxfattribs={"layer": layer})

    def _ring(self, centre_world: Any, radius_m: float, layer: str) -> None:
        centre = self._placed([centre_world])
        if centre is not None:
            self._space.add_circle(centre[0].tolist(), radius_m, dxfattribs={"layer": layer})

    def _placed(self, points_world: Any) -> Float[np.ndarray, "n 2"] | None:
        points = np.asarray(points_world, dtype=np.float64).reshape(-1, 2)
        if not np.all(np.isfinite(points)):
            return None
        self._corners.append(points)
        return points

    def _text(
        self, words: str, at_world: Float[np.ndarray, "2"], height_m: float, turn_deg: float, layer: str,
        align: TextEntityAlignment = TextEntityAlignment.MIDDLE_CENTER,
    ) -> None:  # fmt: skip
        # A line of the file is a value: a line break in a world's name would end it.
        line = "".join(each if each.isprintable() else " " for each in words)
        attributes = {"layer": layer, "style": LETTERS}
        text = self._space.add_text(line, height=height_m, rotation=turn_deg, dxfattribs=attributes)
        text.set_placement(at_world.tolist(), align=align)
