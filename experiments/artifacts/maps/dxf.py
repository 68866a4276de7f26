"""The map as a CAD drawing, `map.dxf`: the walls of `map.geojson` on layers, in metres, in the frame of the map."""

from collections.abc import Iterable, Mapping, Sequence
from functools import cache
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Float

from viz.figures.floor_plan import Dimension

WALLS, TENTATIVE, DIMENSIONS, PATH = "WALLS", "WALLS-TENTATIVE", "DIMENSIONS", "PATH"
OPEN_ENDS, NOTES = "OPEN-ENDS", "NOTES"
LETTERS = "CHAINSLAM"
"""Style of the letters."""
CAPITALS = 0.72
"""Height of a capital, which a drawing states, as a share of the letters' height, which the floor plan states."""
RING_M, START_M, NOTE_M = 0.2, 0.12, 0.2
"""Radius of the rings around open ends and around the start, and height of the letters of a note."""
SPACE, FIRST_HANDLE = "17", 0x1000
"""The blank drawing's name for its model space, and the first name that it leaves free."""


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


@cache
def _blank() -> str:
    """Return a drawing without shapes, in the oldest format that states its unit (R2000): all that read DXF read it.

    It has the layers, line types and letters of ours. ezdxf wrote it; to import that takes longer than ten steps.
    """
    return (Path(__file__).parent / "blank.dxf").read_text(encoding="ascii")


class _Plan:
    """Gathers shapes as lines of the file, a code and a value in turn, and keeps how far they reach."""

    def __init__(self) -> None:
        self._lines: list[str] = []
        self._shapes = 0
        self._corners: list[Float[np.ndarray, "_ 2"]] = []

    @property
    def bounds(self) -> tuple[Float[np.ndarray, "2"], Float[np.ndarray, "2"]]:
        """The lower left and the upper right corner around all shapes, m; zeros where there are none."""
        points = np.concatenate(self._corners) if self._corners else np.zeros((1, 2))
        return points.min(axis=0), points.max(axis=0)

    def drawing(self, low_world: Float[np.ndarray, "2"], high_world: Float[np.ndarray, "2"]) -> bytes:
        """Return the file, which a program opens with all between two corners in sight."""
        middle, size = 0.5 * (low_world + high_world), high_world - low_world
        values = {
            **dict(
                zip(("LOW_X", "LOW_Y", "HIGH_X", "HIGH_Y"), (*low_world.tolist(), *high_world.tolist()), strict=True)
            ),
            **dict(zip(("MIDDLE_X", "MIDDLE_Y"), middle.tolist(), strict=True)),
            "TALL": 1.2 * max(float(size.max()), 1.0),
            "NEXT": f"{FIRST_HANDLE + self._shapes:X}",
        }
        text = _blank()
        for name, value in values.items():
            text = text.replace(f"@{name}@", str(value))
        text = text.replace("@ENTITIES@\n", "".join(f"{line}\n" for line in self._lines))
        # A letter that the code page lacks stands by its number.
        escaped = (each if _is_western(each) else f"\\U+{ord(each):04x}" for each in text)
        return "".join(escaped).encode("cp1252")

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
        self._text(words, corner_world, NOTE_M, 0.0, NOTES, is_centred=False)

    def _way(self, points_world: Any, layer: str, closed: bool = False) -> None:
        points = self._placed(points_world)
        if points is None:
            return
        if len(points) == 2 and not closed:
            self._shape("LINE", layer, "AcDbLine", *_at(points[0]), *_at(points[1], 1))
            return
        corners = [pair for x, y in points.tolist() for pair in ((10, x), (20, y))]
        self._shape("LWPOLYLINE", layer, "AcDbPolyline", (90, len(points)), (70, int(closed)), *corners)

    def _ring(self, centre_world: Any, radius_m: float, layer: str) -> None:
        centre = self._placed([centre_world])
        if centre is not None:
            self._shape("CIRCLE", layer, "AcDbCircle", *_at(centre[0]), (40, radius_m))

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
        # A line of the file is a value: a line break in a world's name would end it.
        line = "".join(each if each.isprintable() else " " for each in words)
        across, along = [(72, 1)] * is_centred, [(73, 2)] * is_centred
        self._shape(
            "TEXT", layer, "AcDbText", *_at(at_world), (40, height_m), (1, line), (50, turn_deg), (7, LETTERS),
            *across, *_at(at_world, 1), (100, "AcDbText"), *along,
        )  # fmt: skip

    def _shape(self, kind: str, layer: str, marker: str, *values: tuple[int, object]) -> None:
        handle = f"{FIRST_HANDLE + self._shapes:X}"
        self._shapes += 1
        begin = ((0, kind), (5, handle), (330, SPACE), (100, "AcDbEntity"), (8, layer), (100, marker))
        for code, value in (*begin, *values):
            self._lines += [f"{code:3}", str(value)]


def _at(point_world: Float[np.ndarray, "2"], nth: int = 0) -> list[tuple[int, object]]:
    """Return the codes and values of the nth point of a shape."""
    x, y = point_world.tolist()
    return [(10 + nth, x), (20 + nth, y), (30 + nth, 0.0)]


def _is_western(letter: str) -> bool:
    try:
        letter.encode("cp1252")
    except UnicodeEncodeError:
        return False
    return True
