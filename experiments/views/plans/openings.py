"""Doors, windows and passages: gaps in a wall, from one of its ends to where a wall stands again."""

from dataclasses import dataclass, replace

import numpy as np
import shapely
from jaxtyping import Float
from shapely.geometry.base import BaseGeometry

from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.map.chains import HEAD, TAIL

from .faces import END, Faces, Node
from .sight import FACING_RAD, NOTHING, first_hits

LEAST_M, MOST_M = 0.35, 2.5
"""Widths of openings; what is narrower is a gap in the map."""
JAMB_M = 0.6
"""Depth of a door's side: the end face of a wall as thick as this at most."""
LONG_M = 0.25
"""Shorter walls are end faces themselves."""
ASIDE_M = 0.05
"""The pieces of wall on both sides of an opening are on one line to this."""
BEHIND_M = 0.15
"""How far behind a wall floor was seen through a gap."""
STEEP = float(np.cos(np.deg2rad(20.0)))
"""A wall that bounds an opening sidewise stands at right angles to it, to 20 degrees."""


@dataclass(frozen=True)
class Gap:
    """A gap in a wall, seen from one of its sides."""

    first: Node
    """Where the wall ends ..."""
    second: Node
    """... and where a wall stands again."""
    width_m: float
    is_seen: bool
    """Whether a wall turns away at one of its ends, as at the side of a door, or the robot saw through. Otherwise the
    wall may go on there, and was only not seen."""


def gaps(faces: Faces, solid: BaseGeometry | None = None) -> list[Gap]:
    """Return the gaps of all walls, each side of a wall by itself, the narrowest first and no end twice.

    `solid` is all that the robot did not see free, in the frame of the map.
    """
    found = [
        gap for wall in range(len(faces)) for side in (HEAD, TAIL) if (gap := _from(faces, wall, side)) is not None
    ]
    taken: set[Node] = set()
    kept = []
    for gap in sorted(found, key=lambda each: (each.width_m, each.first, each.second)):
        if gap.first in taken or gap.second in taken:
            continue
        taken |= {gap.first, gap.second}
        kept.append(gap if gap.is_seen or solid is None else replace(gap, is_seen=_is_through(faces, gap, solid)))
    return kept


def _is_through(faces: Faces, gap: Gap, solid: BaseGeometry) -> bool:
    """Return whether the robot saw floor in a gap, and behind it."""
    ends = np.array([faces.place(gap.first), faces.place(gap.second)])
    on = ends[0] + np.array([[0.3], [0.5], [0.7]]) * (ends[1] - ends[0])
    behind = on + BEHIND_M * normals(faces.means[gap.first.wall, 0])
    return not shapely.contains_xy(solid, *np.concatenate([on, behind]).T).any()


def _from(faces: Faces, wall: int, side: int) -> Gap | None:
    """Return the gap beyond one end of a wall, None where the wall meets another there, and for end faces."""
    node = faces.node(wall, side)
    if faces.lengths_m[wall] < LONG_M or (node.other != END and not faces.is_convex(wall, side)):
        return None
    ahead = (1.0 if side == HEAD else -1.0) * directions(faces.means[wall, 0])
    at = faces.ends_world[wall, side]
    on = _goes_on(faces, wall, side, at, ahead)
    # At the corner of a room that is no rectangle a wall turns away, too: there it is no end face.
    against = _runs_into(faces, wall, at, ahead) if node.other == END or _is_jamb(faces, wall, side) else None
    best = min((each for each in (on, against) if each is not None), key=lambda each: each[0], default=None)
    if best is None or not LEAST_M <= best[0] <= MOST_M:
        return None
    width, second, is_turned = best
    return Gap(node, second, width, node.other != END or is_turned)


def _is_jamb(faces: Faces, wall: int, side: int) -> bool:
    """Return whether a wall ends there: it turns away, and after an end face turns away again."""
    node = faces.corners[wall, side]
    face = node.other if node.wall == wall else node.wall
    return bool(faces.lengths_m[face] <= JAMB_M) and faces.is_convex(face, side)


def _goes_on(
    faces: Faces, wall: int, side: int, at: Float[np.ndarray, "2"], ahead: Float[np.ndarray, "2"]
) -> tuple[float, Node, bool] | None:
    """Return how far away, and where, the wall goes on behind a gap."""
    other_side = TAIL if side == HEAD else HEAD
    to = faces.ends_world[:, other_side] - at
    far, aside = to @ ahead, np.abs(to @ normals(faces.means[wall, 0]))
    same = np.cos(faces.means[:, 0] - faces.means[wall, 0]) > np.cos(FACING_RAD)
    rows = np.flatnonzero(same & (aside <= ASIDE_M) & (far >= LEAST_M) & (far <= MOST_M))
    rows = np.array(
        [row for row in rows.tolist() if row != wall and _may_begin(faces, row, other_side)], dtype=np.int64
    )
    if not len(rows):
        return None
    row = int(rows[far[rows].argmin()])
    return float(far[row]), faces.node(row, other_side), faces.is_convex(row, other_side)


def _may_begin(faces: Faces, wall: int, side: int) -> bool:
    return (wall, side) not in faces.corners or faces.is_convex(wall, side)


def _runs_into(
    faces: Faces, wall: int, at: Float[np.ndarray, "2"], ahead: Float[np.ndarray, "2"]
) -> tuple[float, Node, bool] | None:
    """Return how far away, and where, a gap ends at a wall that stands across it."""
    neighbour = faces.corners.get((wall, HEAD)), faces.corners.get((wall, TAIL))
    own = {row for node in neighbour if node is not None for row in (node.wall, node.other)} | {wall}
    rows = np.array([row for row in range(len(faces)) if row not in own], dtype=int)
    hit, far = first_hits(at[None], ahead[None], faces.ends_world[rows])
    if hit[0] == NOTHING:
        return None
    row = int(rows[hit[0]])
    if normals(faces.means[row, 0]) @ ahead < STEEP:
        return None
    return float(far[0]), Node(wall, row), False
