"""The map as a CAD drawing, `map.dxf`: the walls of `map.geojson` on layers, in metres, in the frame of the map."""

import io
from collections.abc import Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.viz.floor_plan import Dimension

WALLS, TENTATIVE, DIMENSIONS, PATH = "WALLS", "WALLS-TENTATIVE", "DIMENSIONS", "PATH"
OPEN_ENDS, NOTES = "OPEN-ENDS", "NOTES"
DASHED = "CHAINSLAM-DASHED"
LAYERS = {
    WALLS: (7, 35, "Continuous"),
    TENTATIVE: (8, 18, DASHED),
    DIMENSIONS: (5, 13, "Continuous"),
    PATH: (3, 13, "Continuous"),
    OPEN_ENDS: (1, 18, "Continuous"),
    NOTES: (8, 13, "Continuous"),
}
"""Colour (in the CAD palette), line width in 0.01 mm, and line type of each layer."""
DASH_M = 0.2, -0.1
LETTERS = "CHAINSLAM"
"""Text style; by its name the reader of worlds recognises a drawing written by chainslam."""
CAPITALS = 0.72
"""Height of capitals, which DXF states, as a share of the letter height, which the floor plan states."""
RING_M, START_M, NOTE_M = 0.2, 0.12, 0.2
"""Radius of the rings around open ends and the start, and letter height of notes."""
VERSION = "R2000"
"""The oldest format that states its unit, which every DXF reader supports."""


def map_dxf(features: Iterable[Mapping[str, Any]], dimensions: Sequence[Dimension], title: str) -> bytes:
    """Return the drawing of the features of `map_geojson`, world frame, m, with lengths and areas beside them.

    A chain is a polyline on the layer WALLS, closed where the chain is; each tentative wall is a line on a layer of
    its own. A shape with a coordinate that is not finite is left out. The same input gives the same bytes.
    """
    plan = _Plan()
    for feature in features:
        plan.feature(feature)
    for dimension in dimensions:
        plan.dimension(dimension)
    low, high = plan.bounds
    words = [title, *(["lengths in m, areas in m², with 95 % intervals"] if dimensions else [])]
    for line, each in enumerate(words):
        plan.note(each, low - [0.0, (2.0 + 1.6 * line) * NOTE_M])
    return plan.drawing(low, high)


@contextmanager
def without_time() -> Iterator[None]:
    """Remove time stamps and identifiers, so that the same map gives the same bytes."""
    from ezdxf import options  # type: ignore[attr-defined]

    before, options.write_fixed_meta_data_for_testing = options.write_fixed_meta_data_for_testing, True
    try:
        yield
    finally:
        options.write_fixed_meta_data_for_testing = before


class _Plan:
    """Collects the shapes of a drawing and their extent."""

    def __init__(self) -> None:
        # Importing it takes longer than ten steps, and most commands write no drawing.
        from ezdxf import units
        from ezdxf.filemanagement import new

        with without_time():
            self._document = new(VERSION, units=units.M)
        self._document.linetypes.add(DASHED, [sum(map(abs, DASH_M)), *DASH_M], description="not confirmed yet")
        self._document.styles.add(LETTERS, font="arial.ttf")
        for name, (colour, width, line) in LAYERS.items():
            self._document.layers.add(name, color=colour, lineweight=width, linetype=line)
        self._space = self._document.modelspace()
        self._corners: list[Float[np.ndarray, "_ 2"]] = []

    @property
    def bounds(self) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
        """Lower left and upper right corner of all shapes, m; zeros without shapes."""
        points = np.concatenate(self._corners) if self._corners else np.zeros((1, 2))
        return points.min(axis=0), points.max(axis=0)

    def drawing(self, low_world: Float[np.ndarray, "2"], high_world: Float[np.ndarray, "2"]) -> bytes:
        """Return the file, with a view that shows everything between two corners."""
        size = high_world - low_world
        for name, at in (("EXT", (low_world, high_world)), ("LIM", (low_world, high_world))):
            for end, corner in zip(("MIN", "MAX"), at, strict=True):
                x, y = corner.tolist()
                self._document.header[f"${name}{end}"] = (x, y, 0.0) if name == "EXT" else (x, y)
        self._space.reset_extents((*low_world.tolist(), 0.0), (*high_world.tolist(), 0.0))
        self._document.set_modelspace_vport(
            1.2 * max(float(size.max()), 1.0), (0.5 * (low_world + high_world)).tolist()
        )
        text = io.StringIO()
        with without_time():
            self._document.write(text)
        return self._document.encode(text.getvalue())

    def feature(self, feature: Mapping[str, Any]) -> None:
        """Draw a feature of `map.geojson` of a kind that a floor plan shows."""
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
        """Write a length beside its wall, or an area in its room, as in the floor plan."""
        if told.shown:
            self._text(told.shown, told.beside_world, CAPITALS * told.letters_m, -told.clockwise_deg, DIMENSIONS)

    def note(self, words: str, corner_world: Float[np.ndarray, "2"]) -> None:
        """Write a line of text that starts at a point."""
        self._text(words, corner_world, NOTE_M, 0.0, NOTES, is_centred=False)

    def _way(self, points_world: Any, layer: str, closed: bool = False) -> None:
        points = self._placed(points_world)
        if points is None:
            return
        on = {"layer": layer}
        if len(points) == 2 and not closed:
            self._space.add_line(points[0].tolist(), points[1].tolist(), dxfattribs=on)
        else:
            self._space.add_lwpolyline(points.tolist(), close=closed, dxfattribs=on)

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
        is_centred: bool = True,
    ) -> None:  # fmt: skip
        from ezdxf.enums import TextEntityAlignment

        # A value takes one line of the file, so a line break in a world's name would end it.
        line = "".join(each if each.isprintable() else " " for each in words)
        on = {"layer": layer, "style": LETTERS}
        text = self._space.add_text(line, height=height_m, rotation=turn_deg, dxfattribs=on)
        align = TextEntityAlignment.MIDDLE_CENTER if is_centred else TextEntityAlignment.LEFT
        text.set_placement(at_world.tolist(), align=align)
