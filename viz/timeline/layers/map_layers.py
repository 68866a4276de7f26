"""The map under `/world/BACKEND`: walls, corners, open ends, the goal, the seen floor."""

from collections.abc import Sequence
from typing import Any

import numpy as np
import rerun as rr
from jaxtyping import Float, Int

from chainslam.explore.goal import Goal
from chainslam.slam.geometry.lines import normals

from ... import palette
from ..block import Block
from ..colours import packed
from ..recording import RerunRecording
from .per_wall import PerWall

END_M = 0.16
"""Radius of the circle at an open end, m."""
PLACES = {
    "unseen": "unseen floor",
    "unexplained": "not a wall of the map",
    "known-walls": "walls known well",
    "start": "the start",
}
"""Goals other than open ends, by their kind, in words."""
QUANTUM_M = 0.005
"""Things are drawn again when they have moved by about this."""


def style(radius: float, order: float, **more: Any) -> rr.LineStrips2D:
    """Return the style of all lines of an entity: half their width in screen points, and their drawing order."""
    return rr.LineStrips2D.from_fields(radii=rr.Radius.ui_points(radius), draw_order=order, **more)


def words_only() -> rr.Points2D:
    """Return the style of points that only carry labels, which the viewer draws in the colour of their point."""
    return rr.Points2D.from_fields(
        radii=rr.Radius.ui_points(0.1), colors=packed(palette.PAGE), draw_order=50.0, show_labels=True
    )


class WallsLayer:
    """The walls, each an entity of its own, coloured by chain."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._each = PerWall(out, f"/world/{backend}/walls", 2, QUANTUM_M)

    def send(self, block: Block) -> None:
        """Send each wall that moved, changed its colour or was deleted."""
        self._each.send(block, [row.walls.ids for row in block.rows], block.ends, block.colours)


class _Sparse:
    """Rows of an entity, sent only if they differ from the last ones sent."""

    def __init__(self) -> None:
        self._last: bytes | None = None

    def changed(self, tables: Sequence[Float[np.ndarray, "_ _"]]) -> list[int]:
        """Return the rows whose table, after rounding, differs from the row before."""
        rows = []
        for at, table in enumerate(tables):
            key = np.round(table / QUANTUM_M).astype(np.int64).tobytes()
            if key != self._last:
                rows.append(at)
                self._last = key
        return rows


class CornersLayer:
    """Corners of chains."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._entity, self._sparse = out, f"/world/{backend}/corners", _Sparse()
        out.fixed(
            self._entity,
            rr.Points2D.from_fields(radii=rr.Radius.ui_points(2.2), colors=packed(palette.INK), draw_order=26),
        )

    def send(self, block: Block) -> None:
        """Send the corners where they changed."""
        chains = [row.walls.chains for row in block.rows]
        tables = [np.concatenate([np.zeros((0, 2)), *(chain.corners_world for chain in some)]) for some in chains]
        chosen = self._sparse.changed(tables)
        tables = [tables[at] for at in chosen]
        if tables:
            counts = np.array([len(table) for table in tables])
            self._out.points(self._entity, block.moments.take(chosen), counts, np.concatenate(tables))


class OpenEndsLayer:
    """Circles at open ends; grey if the end is blacklisted."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._entity, self._sparse = out, f"/world/{backend}/open_ends", _Sparse()
        out.fixed(self._entity, rr.Ellipses2D.from_fields(line_radii=rr.Radius.ui_points(1.6), draw_order=28))

    def send(self, block: Block) -> None:
        """Send the circles where they changed."""
        tables = []
        for row in block.rows:
            aside = {(end.wall, end.side) for end in row.set_aside}
            ends = [end for chain in row.walls.chains for end in chain.open_ends]
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


class GoalLayer:
    """The goal and the walls to follow towards it."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._world = out, f"/world/{backend}"
        self._goal, self._follow = _Sparse(), _Sparse()
        colour = packed(palette.GOAL)
        out.fixed(
            f"{self._world}/goal", rr.Points2D.from_fields(radii=rr.Radius.ui_points(7), colors=colour, draw_order=47)
        )
        out.fixed(f"{self._world}/goal/name", words_only())
        out.fixed(f"{self._world}/to_follow", style(6.0, 22.0, colors=packed(palette.TO_FOLLOW), show_labels=True))

    def send(self, block: Block) -> None:
        """Send goal and walls where they changed."""
        goals = [None if row.ended else row.decision.goal for row in block.rows]
        tables = [
            np.zeros((0, 3)) if goal is None else np.array([[*goal.position_world, _number(goal.wall)]])
            for goal in goals
        ]
        chosen = self._goal.changed(tables)
        if chosen:
            counts = np.array([len(tables[at]) for at in chosen])
            places = np.concatenate([tables[at] for at in chosen])[:, :2]
            labels = [goal_words(goal) for goal in (goals[at] for at in chosen) if goal is not None]
            when = block.moments.take(chosen)
            self._out.points(f"{self._world}/goal", when, counts, places)
            self._out.points(f"{self._world}/goal/name", when, counts, places, labels=labels)
        walls = [_to_follow(block, at) for at in range(len(block))]
        chosen = self._follow.changed([np.column_stack([ids, ends.reshape(len(ids), 4)]) for ids, ends in walls])
        if chosen:
            counts = np.array([len(walls[at][0]) for at in chosen])
            ends = np.concatenate([walls[at][1] for at in chosen])
            # The goal's label already names its own wall.
            about = [block.rows[at].decision.goal for at in chosen]
            ends_at = [None if goal is None else goal.wall for goal in about]
            labels = [
                "" if wall == end else f"wall {wall}"
                for at, end in zip(chosen, ends_at, strict=True)
                for wall in walls[at][0]
            ]
            self._out.strips(f"{self._world}/to_follow", block.moments.take(chosen), counts, ends, labels=labels)


def goal_words(goal: Goal) -> str:
    """Return a goal in few words, without its reason."""
    return f"goal: {PLACES.get(goal.kind, goal.kind)}" if goal.wall is None else f"goal: open end of wall {goal.wall}"


def _number(wall: int | None) -> int:
    return -1 if wall is None else wall


def _to_follow(block: Block, at: int) -> tuple[Int[np.ndarray, " k"], Float[np.ndarray, "k 2 2"]]:
    """Return the walls to follow, shifted to their free side so that the walls themselves remain visible."""
    row, here = block.rows[at], block.walls_at(at)
    chosen = np.isin(row.walls.ids, () if row.ended else row.decision.walls_to_follow)
    return row.walls.ids[chosen], block.ends[here][chosen] - 0.12 * normals(block.lines[here][chosen, 0])[:, None, :]


class SweptLayer:
    """The floor that the scans have seen free, as a picture under everything."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
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
