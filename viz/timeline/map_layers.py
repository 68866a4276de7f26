"""The map under `/world/BACKEND`: walls, corners, open ends, the goal, the swept floor."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float

from slam.geometry.lines import normals

from .. import palette
from .block import Block
from .colours import packed
from .moment import Moment
from .per_wall import PerWall
from .recording import Recording

END_M = 0.16
"""Radius of the circle at an open end, m."""
QUANTUM_M = 0.005
"""A thing is drawn again when it has moved by about this."""


def style(radius: float, order: float, **more: Any) -> rr.LineStrips2D:
    """Return what holds for all lines of an entity: half their width in points of the screen, and what lies on top."""
    return rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(radius), draw_order=order, **more)


class Walls:
    """The walls, each an entity of its own, coloured by chain."""

    def __init__(self, out: Recording, backend: str) -> None:
        self._each = PerWall(out, f"/world/{backend}/walls", 2, QUANTUM_M)

    def send(self, block: Block) -> None:
        """Send each wall where it moved, changed its colour or went."""
        self._each.send(block, [row.ids for row in block.rows], block.ends, block.colours)


class _Sparse:
    """Rows of an entity, sent only where they differ from what was sent last."""

    def __init__(self) -> None:
        self._last: bytes | None = None

    def changed(self, tables: Sequence[Float[np.ndarray, "_ _"]]) -> list[int]:
        """Return the rows whose table, rounded, is not that of the row before."""
        rows = []
        for at, table in enumerate(tables):
            key = np.round(table / QUANTUM_M).astype(np.int64).tobytes()
            if key != self._last:
                rows.append(at)
                self._last = key
        return rows


class Corners:
    """Where two walls of a chain meet."""

    def __init__(self, out: Recording, backend: str) -> None:
        self._out, self._entity, self._sparse = out, f"/world/{backend}/corners", _Sparse()
        out.fixed(
            self._entity,
            rr.Points2D.from_fields(radii=rr.Radius.ui_points(2.2), colors=packed(palette.INK), draw_order=26),
        )

    def send(self, block: Block) -> None:
        """Send the corners where they changed."""
        tables = [
            np.concatenate([np.zeros((0, 2)), *(chain.corners_world for chain in row.chains)]) for row in block.rows
        ]
        chosen = self._sparse.changed(tables)
        tables = [tables[at] for at in chosen]
        if tables:
            counts = np.array([len(table) for table in tables])
            self._out.points(self._entity, block.moments.take(chosen), counts, np.concatenate(tables))


def _corners(row: Moment) -> Float[np.ndarray, "c 2"]:
    return np.concatenate([np.zeros((0, 2)), *(chain.corners_world for chain in row.chains)])


class OpenEnds:
    """Circles at open ends; grey where exploration gave one up."""

    def __init__(self, out: Recording, backend: str) -> None:
        self._out, self._entity, self._sparse = out, f"/world/{backend}/open_ends", _Sparse()
        out.fixed(self._entity, rr.Ellipses2D.from_fields(line_radii=rr.Radius.ui_points(1.6), draw_order=28))

    def send(self, block: Block) -> None:
        """Send the circles where they changed."""
        tables = []
        for row in block.rows:
            aside = {(end.wall, end.side) for end in row.set_aside}
            ends = [end for chain in row.chains for end in chain.open_ends]
            tables.append(
                np.array([(*end.position_world, (end.wall, end.side) in aside) for end in ends]).reshape(-1, 3)
            )
        chosen = self._sparse.changed(tables)
        if not chosen:
            return
        counts = np.array([len(tables[at]) for at in chosen])
        table = np.concatenate([tables[at] for at in chosen])
        kinds = np.array([packed(palette.ALARM), packed(palette.TENTATIVE)], dtype=np.uint32)
        self._out.circles(
            self._entity, block.moments.take(chosen), counts, table[:, :2], np.full(len(table), END_M),
            kinds[table[:, 2].astype(np.int64)],
        )  # fmt: skip


class Plan:
    """The goal and the walls to follow towards it."""

    def __init__(self, out: Recording, backend: str) -> None:
        self._out, self._world = out, f"/world/{backend}"
        self._goal, self._follow = _Sparse(), _Sparse()
        colour = packed(palette.GOAL)
        out.fixed(
            f"{self._world}/goal",
            rr.Points2D.from_fields(radii=rr.Radius.ui_points(6), colors=colour, draw_order=42, show_labels=True),
        )
        out.fixed(f"{self._world}/to_follow", style(6.0, 22.0, colors=packed(palette.TO_FOLLOW)))

    def send(self, block: Block) -> None:
        """Send goal and walls where they changed."""
        goals = [
            np.zeros((0, 2)) if row.goal is None or row.ended else row.goal.position_world[None] for row in block.rows
        ]
        chosen = self._goal.changed(goals)
        if chosen:
            counts = np.array([len(goals[at]) for at in chosen])
            places = np.concatenate([goals[at] for at in chosen])
            self._out.points(
                f"{self._world}/goal", block.moments.take(chosen), counts, places, labels=["goal"] * len(places)
            )
        walls = [_to_follow(block, at) for at in range(len(block))]
        chosen = self._follow.changed([ends.reshape(-1, 4) for ends in walls])
        if chosen:
            counts = np.array([len(walls[at]) for at in chosen])
            ends = np.concatenate([walls[at] for at in chosen])
            self._out.strips(f"{self._world}/to_follow", block.moments.take(chosen), counts, ends)


def _to_follow(block: Block, at: int) -> Float[np.ndarray, "k 2 2"]:
    """Return the walls to follow, moved a little to their free side so that the walls themselves stay to be seen."""
    row, here = block.rows[at], block.walls_at(at)
    if not row.follow or row.ended:
        return np.zeros((0, 2, 2))
    chosen = np.isin(row.ids, row.follow)
    return block.ends[here][chosen] - 0.12 * normals(block.lines[here][chosen, 0])[:, None, :]


class Swept:
    """The floor that the scans have seen free, as a picture under everything."""

    def __init__(self, out: Recording, backend: str) -> None:
        self._out, self._entity = out, f"/world/{backend}/swept"
        out.fixed(self._entity, rr.SegmentationImage.from_fields(draw_order=-10.0))

    def send(self, block: Block) -> None:
        """Send the pictures."""
        chosen = [at for at, row in enumerate(block.rows) if row.swept is not None]
        pictures = [row.swept for row in block.rows if row.swept is not None]
        if pictures:
            corners = np.array([picture.corner_world for picture in pictures])
            grids = [picture.free for picture in pictures]
            self._out.grids(self._entity, block.moments.take(chosen), grids, corners, pictures[0].cell_m)
