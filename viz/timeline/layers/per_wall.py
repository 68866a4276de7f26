"""Things that every wall has, one entity for each, drawn again only if they changed."""

from collections.abc import Sequence
from typing import Any

import numpy as np
from jaxtyping import Float, Int, UInt32

from ...shapes import Changes, rounded
from ..block import Block
from ..drawn_step import DrawnStep
from ..recording import RerunRecording, Timestamps


class PerWall:
    """One strip of v points for each wall, under a folder; the view determines the width."""

    def __init__(self, out: RerunRecording, folder: str, vertices: int, quantum: float) -> None:
        self._out, self._folder, self._quantum = out, folder, quantum
        self._changes = Changes(2 * vertices + 1)
        self._present = np.zeros(0, dtype=np.int64)

    def send(
        self,
        block: Block,
        ids: Sequence[Int[np.ndarray, " _"]],
        strips: Float[np.ndarray, "k v 2"],
        colours: UInt32[np.ndarray, " k"],
    ) -> None:
        """Send the changed strips of the walls `ids` (some for each row), and an empty one for a deleted wall."""
        at = np.repeat(np.arange(len(block)), [len(some) for some in ids])
        walls = np.concatenate(ids)
        table = np.column_stack([rounded(strips, self._quantum), colours.astype(np.int64)])
        order = np.flatnonzero(self._changes.among(walls, table))
        order = order[np.argsort(walls[order], kind="stable")]
        gone = self._gone(block.rows)
        pieces = np.split(order, np.flatnonzero(np.diff(walls[order])) + 1) if len(order) else []
        for piece in pieces:
            wall = int(walls[piece[0]])
            when, counts = at[piece], np.ones(len(piece), dtype=np.int64)
            if wall in gone:
                when, counts = np.append(when, gone.pop(wall)), np.append(counts, 0)
            self._send_one(wall, block.moments.take(when), counts, strips[piece], colours[piece])
        for wall, row in gone.items():
            self._send_one(wall, block.moments.take([row]), np.zeros(1, dtype=np.int64), strips[:0], colours[:0])

    def _send_one(self, wall: int, moments: Timestamps, counts: Any, strips: Any, colours: Any) -> None:
        self._out.strips(f"{self._folder}/{wall}", moments, counts, strips, colours)

    def _gone(self, rows: Sequence[DrawnStep]) -> dict[int, int]:
        """Return the deleted walls, and their rows."""
        gone: dict[int, int] = {}
        for at, row in enumerate(rows):
            if not np.array_equal(row.walls.ids, self._present):
                gone |= {int(wall): at for wall in np.setdiff1d(self._present, row.walls.ids)}
                self._present = row.walls.ids
        self._changes.forget(np.array(list(gone), dtype=np.int64))
        return gone
