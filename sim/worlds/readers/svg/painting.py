"""The painter's order: light shapes hide the walls below them.

A dark fill is solid where no light shape hides it. A dark stroke is a wall of 0.1 m where any of its width is visible.
All in metres.
"""

from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry
from shapely.ops import substring

from ...rooms import BROAD_M, WALL_M, areas
from .pieces import Group, Piece, filled

SLIVER_M = 5e-3
"""What is left of a wall narrower than this, or shorter, was meant to be hidden."""
SHARE = 0.7
"""Of a stroke's width: where more of it than this is hidden, nothing of it counts as seen."""


@dataclass(frozen=True, eq=False)
class Walls:
    """What is to be seen of the dark pieces."""

    lines: list[shapely.LineString]
    solids: list[shapely.Polygon]
    strokes: int = 0
    """Subpaths of which something is a wall."""
    fills: int = 0
    """Shapes of which something is solid."""
    hidden: int = 0
    """Dark pieces of which nothing is to be seen."""


def walls_of(pieces: list[Piece | Group]) -> Walls:
    """Return the walls that can be seen."""
    flat = _flat(pieces)
    lines: list[shapely.LineString] = []
    solids: list[shapely.Polygon] = []
    strokes = fills = hidden = 0
    for piece, above in zip(flat, _hiders(flat), strict=True):
        if not piece.paint.is_dark:
            continue
        if piece.rule is not None:
            seen = _solid(piece, above)
            solids += seen
            fills += bool(seen)
            hidden += not seen and bool(filled(piece.rings, piece.rule == "evenodd"))
            continue
        for ring in piece.rings:
            some_lines, some_solids = _stroke(piece, ring, above)
            lines += some_lines
            solids += some_solids
            strokes += bool(some_lines or some_solids)
            hidden += not (some_lines or some_solids)
    return Walls(lines, solids, strokes, fills, hidden)


def _flat(pieces: list[Piece | Group]) -> list[Piece]:
    """Return pieces as if there were no groups: within each the painter has been at work, then all of it fades."""
    result: list[Piece] = []
    for piece in pieces:
        if isinstance(piece, Piece):
            result.append(piece)
            continue
        inner = _flat(piece.pieces)
        hiders = _hiders(inner)
        for each, above in zip(inner, hiders, strict=True):
            faded = replace(each, paint=each.paint.faded(piece.opacity))
            if above is not None and faded.paint.is_dark:
                shown = each.area().envelope.buffer(1.0).difference(above)
                faded = replace(faded, clip=shown if each.clip is None else shown.intersection(each.clip))
            result.append(faded)
    return result


def _hiders(flat: list[Piece]) -> list[BaseGeometry | None]:
    """Return for each dark piece what hides of it: light paint above it on which no dark paint lies again."""
    light = [i for i, piece in enumerate(flat) if piece.paint.hides]
    dark = [i for i, piece in enumerate(flat) if piece.paint.is_dark]
    result: list[BaseGeometry | None] = [None] * len(flat)
    if not light or not dark or light[-1] < dark[0]:
        return result
    light_areas = [flat[i].area() for i in light]
    # A wall that is thinner on paper than in the world hides no more than on paper.
    dark_areas = [flat[i].area() for i in dark]
    over_light, over_dark = shapely.STRtree(light_areas), shapely.STRtree(dark_areas)
    left: dict[int, BaseGeometry] = {}

    def remaining(at: int) -> BaseGeometry:
        if at not in left:
            again = [dark_areas[j] for j in over_dark.query(light_areas[at], "intersects") if dark[j] > light[at]]
            left[at] = light_areas[at].difference(shapely.union_all(again)) if again else light_areas[at]
        return left[at]

    for k, i in enumerate(dark):
        reach = dark_areas[k] if flat[i].rule is not None else dark_areas[k].buffer(WALL_M)
        above = [remaining(int(j)) for j in over_light.query(reach, "intersects") if light[j] > i]
        result[i] = shapely.union_all(above) if above else None
    return result


def _solid(piece: Piece, above: BaseGeometry | None) -> list[shapely.Polygon]:
    whole = filled(piece.rings, piece.rule == "evenodd")
    if above is None and piece.clip is None:
        return whole
    result = []
    for part in whole:
        seen = part if piece.clip is None else part.intersection(piece.clip)
        seen = seen if above is None else seen.difference(above)
        if seen.equals(part):
            result.append(part)
            continue
        for rest in areas(seen):
            core = rest.buffer(-0.5 * SLIVER_M, join_style="mitre")
            grown = core.buffer(0.505 * SLIVER_M, join_style="mitre", mitre_limit=10.0)
            result += areas(shapely.make_valid(grown).intersection(rest))
    return result


def _stroke(
    piece: Piece, ring: Float[np.ndarray, "n 2"], above: BaseGeometry | None
) -> tuple[list[shapely.LineString], list[shapely.Polygon]]:
    """Return the lines of a stroke's walls, and what is too short for a line."""
    if above is None and piece.clip is None:
        return [shapely.LineString(ring)], []
    # A stroke as wide as no wall is, such as one of a unit that nobody chose, says nothing of the wall's width.
    width = piece.page_width
    half = 0.5 * (width if width and width < BROAD_M else WALL_M)
    lines: list[shapely.LineString] = []
    solids: list[shapely.Polygon] = []
    for points, cut_first, cut_last in _runs(ring, half, piece.clip, above):
        line = shapely.LineString(points)
        # Walls end in a square of half their width beyond the line: a cut is where that square ends.
        first, last = (0.5 * WALL_M if cut else 0.0 for cut in (cut_first, cut_last))
        if line.length < SLIVER_M:
            continue
        if line.length > first + last + SLIVER_M:
            rest = substring(line, first, line.length - last) if first or last else line
            lines.append(shapely.LineString(shapely.get_coordinates(rest)))
        else:
            solids += areas(line.buffer(0.5 * WALL_M, cap_style="flat", join_style="mitre"))
    return lines, solids


def _runs(
    ring: Float[np.ndarray, "n 2"], half: float, clip: BaseGeometry | None, above: BaseGeometry | None
) -> list[tuple[Float[np.ndarray, "_ 2"], bool, bool]]:
    """Return the parts of a line of which some of the width can be seen, and which of their ends are cut."""
    shapely.prepare([each for each in (clip, above) if each is not None])
    runs: list[tuple[list[Float[np.ndarray, 2]], bool, bool]] = []
    is_open = False
    for a, b in pairwise(ring):
        size = float(np.hypot(*(b - a)))
        if size == 0.0:
            continue
        for begin, end in _intervals(a, b, size, half, clip, above):
            p, q = a + (b - a) * (begin / size), a + (b - a) * (end / size)
            if is_open and begin == 0.0:
                runs[-1][0].append(q)
                runs[-1] = (runs[-1][0], runs[-1][1], end < size)
            else:
                runs.append(([p, q], begin > 0.0, end < size))
            is_open = False
        is_open = bool(runs) and not runs[-1][2] and bool(np.all(runs[-1][0][-1] == b))
    return [(np.array(points), first, last) for points, first, last in runs]


def _intervals(
    a: Float[np.ndarray, "2"],
    b: Float[np.ndarray, "2"],
    size: float,
    half: float,
    clip: BaseGeometry | None,
    above: BaseGeometry | None,
) -> list[tuple[float, float]]:
    """Return where along a straight piece of a stroke something of its width can be seen, m from its first end."""
    along = (b - a) / size
    across = half * np.array([-along[1], along[0]])
    strip: BaseGeometry = shapely.Polygon([a + across, b + across, b - across, a - across])
    # Most pieces of most drawings are nowhere near anything that hides them: this is the quick way to know.
    if (above is None or above.disjoint(strip)) and (clip is None or clip.covers(strip)):
        return [(0.0, size)]
    seen = strip if clip is None else strip.intersection(clip)
    seen = seen if above is None else seen.difference(above)
    spans = []
    # What is narrower than the share that counts goes, and the rest keeps its square ends.
    least = (1 - SHARE) * half
    core = seen.buffer(-least, join_style="mitre")
    for part in areas(core.buffer(least, join_style="mitre")):
        reach = (shapely.get_coordinates(part) - a) @ along
        low, high = float(reach.min()), float(reach.max())
        low, high = (0.0 if low < 1e-6 else low), (size if high > size - 1e-6 else high)
        if high - low > SLIVER_M or (low == 0.0 and high == size):
            spans.append((low, high))
    merged: list[tuple[float, float]] = []
    for low, high in sorted(spans):
        if merged and low <= merged[-1][1] + SLIVER_M:
            merged[-1] = (merged[-1][0], max(merged[-1][1], high))
        else:
            merged.append((low, high))
    return merged
