"""All dimensions of a map, and what of it is wall, furniture or clutter."""

from dataclasses import dataclass
from functools import cached_property
from pathlib import Path

import numpy as np
import shapely
from jaxtyping import Bool
from shapely.geometry.base import BaseGeometry

from chainslam.slam.geometry.lines import normals
from chainslam.slam.map.chains import HEAD, TAIL

from ...scoring.maps.measurements import Measured
from .faces import Faces, read_faces, read_solid
from .measuring import Dimension, Kind, between_nodes, between_walls, main_direction
from .openings import Gap, gaps
from .rooms import Room, rooms
from .sight import FACING_RAD, Pair, facing

LONG_M = 0.3
"""Shorter walls have no direction that a distance between walls could be taken by."""
WIDEST_M = 15.0
OVERLAP_M = 0.5
"""Walls are dimensioned where they face each other over this length."""
THICKEST_M = 0.6
FACES_OVERLAP_M = 0.3
FURNITURE_M2 = 4.0
"""What stands alone in a room is furniture if it covers less than this; otherwise it is a part of the building ..."""
THIN_M, PIECE_M = 0.2, 1.0
"""... as is a piece of wall: on average no thicker than this, and at least as long."""
CLUTTER_M = 1.0
"""A shorter open chain is clutter if it stands by itself."""


@dataclass(frozen=True)
class Survey:
    """A map, measured."""

    faces: Faces
    furniture: frozenset[int]
    """Rows of walls around small objects."""
    clutter: frozenset[int]
    """Rows of short chains that stand alone."""
    backs: tuple[Pair, ...]
    """Walls of which both faces were seen."""
    gaps: tuple[Gap, ...]
    rooms: tuple[Room, ...]
    dimensions: tuple[Dimension, ...]
    """All of them, by kind."""
    square: Bool[np.ndarray, " n"] | None = None
    """Which walls surely have the main direction or are square to it; None where that is not known."""

    @cached_property
    def direction(self) -> Measured:
        """Main direction of the walls, rad."""
        return main_direction(self.faces, self.square)

    @property
    def openings(self) -> list[Gap]:
        """The gaps through which a way leads."""
        return [gap for gap in self.gaps if gap.is_seen]


def survey_at(folder: Path) -> Survey:
    """Measure the map in the folder of a run or of a replayed log; raises UsageError for anything else."""
    return survey(read_faces(folder), read_solid(folder))


def survey(faces: Faces, solid: BaseGeometry | None = None) -> Survey:
    """Measure a map; `solid` is all that the robot did not see free, where that is known."""
    backs = facing(faces, LONG_M, THICKEST_M, FACES_OVERLAP_M, behind=True)
    found = gaps(faces, solid)
    furniture = _furniture(faces)
    held = {row for pair in backs for row in (pair.first, pair.second)}
    held |= {row for gap in found if gap.is_seen for row in (gap.first.wall, gap.second.wall, gap.second.other)}
    clutter = _clutter(faces, held)
    loose = furniture | clutter
    inner = [gap for gap in found if not {gap.first.wall, gap.second.wall, gap.second.other} & loose]
    closed = rooms(faces, inner, set(loose))
    across = [pair for pair in facing(faces, LONG_M, WIDEST_M, OVERLAP_M) if not {pair.first, pair.second} & loose]
    dimensions = [
        *(between_walls(faces, Kind.WIDTH, pair) for pair in across),
        *(between_walls(faces, Kind.THICKNESS, pair) for pair in backs if not {pair.first, pair.second} & loose),
        *_overall(faces, loose),
        *_lengths(faces, loose),
        *(between_nodes(faces, Kind.OPENING, gap.first, gap.second) for gap in inner if gap.is_seen),
        *(room.area for room in closed),
        *(room.perimeter for room in closed),
    ]
    return Survey(
        faces, frozenset(furniture), frozenset(clutter), tuple(backs), tuple(inner), tuple(closed), tuple(dimensions)
    )


def _overall(faces: Faces, loose: set[int]) -> list[Dimension]:
    """Return how far the outermost walls are apart along and across the main direction, inside face to inside face."""
    phi = main_direction(faces).value
    rows = np.array(
        [row for row in range(len(faces)) if row not in loose and faces.lengths_m[row] >= LONG_M], dtype=int
    )
    found = []
    for turn in (phi, phi + 0.5 * np.pi):
        n = normals(np.array(turn))
        cosine, middles = np.cos(faces.means[rows, 0] - turn), faces.ends_world[rows].mean(axis=1)
        far, near = rows[cosine > np.cos(FACING_RAD)], rows[cosine < -np.cos(FACING_RAD)]
        if len(far) and len(near):
            first = int(far[(middles[cosine > np.cos(FACING_RAD)] @ n).argmax()])
            second = int(near[(middles[cosine < -np.cos(FACING_RAD)] @ n).argmin()])
            at = faces.ends_world[[first, second]].reshape(-1, 2).mean(axis=0)
            found.append(between_walls(faces, Kind.OVERALL, Pair(first, second, at, 0.0)))
    return found


def _lengths(faces: Faces, loose: set[int]) -> list[Dimension]:
    """Return the lengths of walls whose two ends are corners."""
    return [
        between_nodes(faces, Kind.LENGTH, faces.corners[wall, TAIL], faces.corners[wall, HEAD])
        for wall in range(len(faces))
        if (wall, TAIL) in faces.corners and (wall, HEAD) in faces.corners
        and faces.lengths_m[wall] >= LONG_M and wall not in loose
    ]  # fmt: skip


def _furniture(faces: Faces) -> set[int]:
    """Return the walls of closed chains that surround something small which is no piece of wall."""
    found: set[int] = set()
    for chain, closed in zip(faces.chains, faces.closed, strict=True):
        ring = shapely.Polygon(faces.ends_world[list(chain), 0] if closed and len(chain) > 2 else None)
        if closed and not ring.exterior.is_ccw and ring.area < FURNITURE_M2 and not _is_piece_of_wall(ring):
            found |= set(chain)
    return found


def _is_piece_of_wall(ring: shapely.Polygon) -> bool:
    half_m = 0.5 * ring.length
    return half_m >= PIECE_M and ring.area <= THIN_M * half_m


def _clutter(faces: Faces, held: set[int]) -> set[int]:
    """Return the walls of short open chains of which none belongs to a known wall or opening."""
    found: set[int] = set()
    for chain, closed in zip(faces.chains, faces.closed, strict=True):
        if not closed and faces.lengths_m[list(chain)].sum() < CLUTTER_M and not held & set(chain):
            found |= set(chain)
    return found
