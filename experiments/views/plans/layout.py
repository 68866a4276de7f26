"""What of a survey is drawn on the sheet, and where: poché, dimension lines outside and inside, rooms, loose layers."""

from collections.abc import Iterator, Sequence

import numpy as np
import shapely
from jaxtyping import Float
from shapely.affinity import rotate
from shapely.geometry.base import BaseGeometry

from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import rotation
from chainslam.slam.map.chains import HEAD, TAIL
from chainslam.viz.figures.plan_sheet import ROOM_LETTER_MM, DimensionLine, Sheet, letters_m, scale_of

from ...scoring.maps.measurements import Measured
from .faces import Faces
from .measuring import Dimension, Kind
from .sight import Pair
from .survey import THICKEST_M, Survey

BAND_M = 0.08
"""Depth drawn for a wall of which one face was seen."""
JOINT_M = 0.11
"""Gaps of twice this width between drawn walls are filled."""
ROW_MM = 7.0
"""Distance between rows of dimensions outside, on paper."""
SQUARE = float(np.cos(np.deg2rad(1.0)))
"""Dimensions within 1 degree of the page's axes are drawn in rows outside."""
REACH = 0.5
"""Dimensions are drawn outside that are no farther from there than this share of the plan."""
SHORTEST_M = 0.3


def sheet_of(found: Survey, title: str, notes: Sequence[str] = ()) -> Sheet:
    """Return the sheet of a survey, turned so that its main direction lies along the page."""
    turn = -found.direction.value
    body, band = _walls(found)
    faces = found.faces
    firm = [row for row in range(len(faces)) if row not in found.furniture | found.clutter]
    labels = [(_turned(room.area.at_world, turn), _area_words(room.area)) for room in found.rooms]
    outline = _turned(faces.ends_world[firm], turn)
    corners = outline.reshape(-1, 2) if len(firm) else np.zeros((1, 2))
    low, high = corners.min(axis=0), corners.max(axis=0)
    scale = scale_of(low - 1.0, high + 1.0)
    return Sheet(
        _on_page(body, turn), _on_page(band, turn), tuple(outline),
        tuple(_turned(faces_of_gap, turn) for faces_of_gap in _closings(found)),
        tuple(_lines(found, turn, low, high, scale, labels)), tuple(labels),
        {name: tuple(_turned(line, turn) for line in lines) for name, lines in loose(found).items()},
        title, tuple(notes), turn,
    )  # fmt: skip


def loose(found: Survey) -> dict[str, list[Float[np.ndarray, "2 2"]]]:
    """Return lines of the map by layer: furniture, clutter, and crosses at the open ends of chains."""
    faces, cross = found.faces, 0.08 * np.array([[[-1.0, -1.0], [1.0, 1.0]], [[-1.0, 1.0], [1.0, -1.0]]])
    ends = [
        faces.ends_world[wall, side]
        for chain, closed in zip(faces.chains, faces.closed, strict=True) if chain and not closed
        for wall, side in ((chain[0], TAIL), (chain[-1], HEAD)) if wall not in found.clutter
    ]  # fmt: skip
    return {
        "furniture": list(faces.ends_world[sorted(found.furniture)]),
        "clutter": list(faces.ends_world[sorted(found.clutter)]),
        "open-ends": [at + stroke for at in ends for stroke in cross],
    }


def words_of(dimension: Dimension) -> str:
    """Return a value with half its 95 % interval."""
    return words(dimension.measured, 3)


def words(measured: Measured, digits: int) -> str:
    """Return a value and half its 95 % interval, which is rounded up."""
    half = np.ceil((measured.interval[1] - measured.value) * 10.0**digits - 1e-9) / 10.0**digits
    return f"{measured.value:.{digits}f} ± {half:.{digits}f}"


def _area_words(area: Dimension) -> str:
    value, half = words(area.measured, 2).split(" ± ")
    return f"{value} m²\n± {half}"


def _closings(found: Survey) -> list[Float[np.ndarray, "2 2"]]:
    return [np.array([found.faces.place(gap.first), found.faces.place(gap.second)]) for gap in found.gaps]


def _walls(found: Survey) -> tuple[BaseGeometry, BaseGeometry]:
    """Return what is solid between two seen faces, and a band behind the other faces, none of it in a room."""
    faces, loose_rows = found.faces, found.furniture | found.clutter
    floor = shapely.union_all([shapely.Polygon(room.outline_world, room.holes_world) for room in found.rooms])
    solid = shapely.union_all(
        [_between(faces, pair) for pair in found.backs if not {pair.first, pair.second} & loose_rows]
    )
    bands = [_behind(faces, row) for row in range(len(faces)) if row not in loose_rows]
    body = shapely.difference(shapely.make_valid(solid), floor)
    # Between two rooms the face of an outer wall is interrupted by the thickness of the wall that meets it.
    whole = shapely.union_all([*bands, body]).buffer(JOINT_M, join_style="mitre").buffer(-JOINT_M, join_style="mitre")
    return body, shapely.difference(whole, shapely.union_all([floor, body]))


def _between(faces: Faces, pair: Pair) -> BaseGeometry:
    """Return what lies between two faces, to the end of the longer one, but not far past the end of the other."""
    t = directions(faces.means[pair.first, 0])
    along = np.sort(faces.ends_world[[pair.first, pair.second]] @ t, axis=1)
    low, high = along.min(axis=0)[0], along.max(axis=0)[1]
    inner = along.max(axis=0)[0], along.min(axis=0)[1]
    reach = min(THICKEST_M, 2.0 * _apart(faces, pair))
    span = max(low, inner[0] - reach), min(high, inner[1] + reach)
    corners = [_at(faces, row, t, value) for row, value in ((pair.first, span[0]), (pair.first, span[1]),
                                                          (pair.second, span[1]), (pair.second, span[0]))]  # fmt: skip
    return shapely.make_valid(shapely.Polygon(corners))


def _apart(faces: Faces, pair: Pair) -> float:
    n = normals(faces.means[pair.first, 0])
    return float(abs((faces.ends_world[pair.second].mean(axis=0) - faces.ends_world[pair.first].mean(axis=0)) @ n))


def _at(faces: Faces, row: int, t: Float[np.ndarray, "2"], value: float) -> Float[np.ndarray, "2"]:
    """Return the point of a wall's line that lies so far along a direction."""
    start, own = faces.ends_world[row, 0], directions(faces.means[row, 0])
    return np.asarray(start + (value - start @ t) / (own @ t) * own)


def _behind(faces: Faces, row: int) -> BaseGeometry:
    ends = faces.ends_world[row]
    back = ends[::-1] + BAND_M * normals(faces.means[row, 0])
    return shapely.make_valid(shapely.Polygon([*ends, *back]))


def _lines(
    found: Survey, turn: float, low: Float[np.ndarray, "2"], high: Float[np.ndarray, "2"], scale: int,
    labels: Sequence[tuple[Float[np.ndarray, "2"], str]],
) -> Iterator[DimensionLine]:  # fmt: skip
    """Choose dimension lines: rows outside on four sides, overall lengths beyond them, and inside what finds room."""
    row_m = 1e-3 * scale * ROW_MM
    taken = [_box(at, letters_m(told.split("\n"), scale, ROOM_LETTER_MM), 0.0) for at, told in labels]
    widths = [each for each in found.dimensions if each.kind is Kind.WIDTH and each.measured.value >= SHORTEST_M]
    used: set[int] = set()
    for axis in (0, 1):
        for sign in (-1.0, 1.0):
            edge = low[1 - axis] - row_m if sign < 0 else high[1 - axis] + row_m
            for each in _row(widths, turn, axis, sign, used, edge, REACH * float(high[1 - axis] - low[1 - axis])):
                yield _outside(each, turn, axis, edge)
        overall = [each for each in found.dimensions if each.kind is Kind.OVERALL and _axis(each, turn) == axis]
        for each in overall[:1]:
            yield _outside(each, turn, axis, low[1 - axis] - 2.0 * row_m)
    openings = [each for each in found.dimensions if each.kind is Kind.OPENING]
    rest = sorted((each for each in widths if id(each) not in used), key=lambda each: -each.overlap_m)
    for each in (*openings, *rest):
        ends, told = _upright(_turned(each.ends_world, turn)), words_of(each)
        line = DimensionLine(ends, 0.0, told)
        box = _box(line.line.mean(axis=0), letters_m(told, scale), np.deg2rad(line.turn_deg))
        stroke = shapely.LineString(ends).buffer(5e-4 * scale)
        if not any(box.intersects(other) or stroke.intersects(other) for other in taken):
            taken += [box, stroke]
            yield line


def _row(
    widths: Sequence[Dimension], turn: float, axis: int, sign: float, used: set[int], edge: float, reach: float
) -> Iterator[Dimension]:
    """Choose the dimensions that stand nearest to one side of the page, within reach, none over another."""
    spans: list[tuple[float, float]] = []
    mine = [each for each in widths if _axis(each, turn) == axis and id(each) not in used]
    mine = [each for each in mine if abs(_turned(each.at_world, turn)[1 - axis] - edge) <= reach]
    for each in sorted(mine, key=lambda each: -sign * _turned(each.at_world, turn)[1 - axis]):
        low, high = np.sort(_turned(each.ends_world, turn)[:, axis]).tolist()
        if all(high <= other[0] + 0.02 or low >= other[1] - 0.02 for other in spans):
            spans.append((low, high))
            used.add(id(each))
            yield each


def _axis(each: Dimension, turn: float) -> int | None:
    """Return along which axis of the page a dimension runs, None for neither."""
    along = np.abs(np.diff(_turned(each.ends_world, turn), axis=0)[0])
    along = along / max(float(np.hypot(*along)), 1e-9)
    return 0 if along[0] >= SQUARE else 1 if along[1] >= SQUARE else None


def _upright(ends: Float[np.ndarray, "2 2"]) -> Float[np.ndarray, "2 2"]:
    """Return the ends in the order in which text along them is read from below or from the right."""
    x, y = ends[1] - ends[0]
    return ends if x > 1e-6 * abs(y) or (abs(x) <= 1e-6 * abs(y) and y > 0.0) else ends[::-1]


def _outside(each: Dimension, turn: float, axis: int, edge: float) -> DimensionLine:
    ends = _turned(each.ends_world, turn)
    ends = ends[np.argsort(ends[:, axis])]
    middle = float(ends[:, 1 - axis].mean())
    offset = (edge - middle) * (1.0 if axis == 0 else -1.0)
    ends[:, 1 - axis] = middle
    return DimensionLine(ends, offset, words_of(each))


def _box(at: Float[np.ndarray, "2"], size: Float[np.ndarray, "2"], turn_rad: float) -> BaseGeometry:
    return rotate(shapely.box(*(at - 0.6 * size), *(at + 0.6 * size)), turn_rad, use_radians=True)


def _turned(points_world: Float[np.ndarray, "*n 2"], turn: float) -> Float[np.ndarray, "*n 2"]:
    return points_world @ rotation(turn).T


def _on_page(shape: BaseGeometry, turn: float) -> BaseGeometry:
    return rotate(shape, turn, origin=(0.0, 0.0), use_radians=True)
