"""The model space (alpha, r) under `/model/BACKEND`, as in the paper's figures 2 and 10(b): where matching is done."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import wrap

from ... import palette
from ...shapes import VAGUE_RAD, VERTICES, ellipses, hessian_cov
from ..block import FUSED, REFUSED, Block
from ..colours import packed, pale
from ..drawn_step import NO_ELLIPSES
from ..recording import RerunRecording
from .map_layers import style
from .per_wall import PerWall

TIMES = 10.0
"""Magnification of its ellipses."""
QUANTUM = 0.02
"""An enlarged ellipse is drawn again when it has changed by about this, rad or m."""


class ModelLayer:
    """Walls as ellipses of three standard deviations, the segments just seen, and which belong together."""

    def __init__(self, out: RerunRecording, backend: str) -> None:
        self._out, self._entity = out, f"/model/{backend}"
        self._walls = PerWall(out, f"{self._entity}/walls", VERTICES, QUANTUM)
        out.fixed(f"{self._entity}/seen", style(0.8, 30.0))
        out.fixed(f"{self._entity}/matches", style(1.4, 32.0, colors=packed(palette.FUSED)))

    def send(self, block: Block) -> None:
        """Send the walls whose ellipse changed, and all segments."""
        self._send_walls(block)
        self._send_segments(block)

    def _send_walls(self, block: Block) -> None:
        asked = [row.walls.ellipses or NO_ELLIPSES for row in block.rows]
        means, anchors, covs = (
            np.concatenate([getattr(e, name) for e in asked]) for name in ("means", "anchors", "covs")
        )
        r = means[:, 1] + np.sum(normals(means[:, 0]) * anchors, axis=-1)
        contours = ellipses(np.column_stack([means[:, 0], r]), hessian_cov(means[:, 0], anchors, covs), TIMES)
        colours = np.concatenate(
            [row.walls.colours[np.searchsorted(row.walls.ids, e.ids)] for row, e in zip(block.rows, asked, strict=True)]
        )
        vague = np.sqrt(covs[:, 0, 0]) > VAGUE_RAD
        colours[vague] = pale(colours[vague])
        self._walls.send(block, [e.ids for e in asked], contours, colours)

    def _send_segments(self, block: Block) -> None:
        kinds, _ = block.verdicts
        at = block.row_of_segment
        seen = np.concatenate([row.segments.lines for row in block.rows])
        alpha, places = wrap(seen[:, 0] + block.poses[at, 2]), block.poses[at, :2]
        lines = np.column_stack([alpha, seen[:, 1] + np.sum(normals(alpha) * places, axis=-1)])
        # Only the segment's own uncertainty is drawn, as if the pose were exact.
        covs = hessian_cov(alpha, places, np.concatenate([row.segments.cov for row in block.rows]))
        walls = _matched_lines(block)
        paired = np.isfinite(walls[:, 0])
        # A segment near alpha = pi may belong to a wall near -pi: it is drawn next to its wall.
        lines[paired, 0] = walls[paired, 0] + wrap(lines[paired, 0] - walls[paired, 0])
        drawn = (kinds == FUSED) | (kinds == REFUSED)
        contours = ellipses(lines[drawn], covs[drawn], TIMES, vertices=9)
        tints = np.where(kinds[drawn] == FUSED, packed(palette.FUSED), packed(palette.REFUSED)).astype(np.uint32)
        vague = np.sqrt(covs[drawn, 0, 0]) > VAGUE_RAD
        tints[vague] = pale(tints[vague])
        self._out.strips(f"{self._entity}/seen", block.moments, block.count(drawn), contours, tints)
        links = np.stack([lines[paired], walls[paired]], axis=1)
        self._out.strips(f"{self._entity}/matches", block.moments, block.count(paired), links)


def _matched_lines(block: Block) -> Float[np.ndarray, "s 2"]:
    """Return the line (alpha, r) of the wall matched with each segment; NaN for none."""
    lines = np.full((len(block.row_of_segment), 2), np.nan)
    first = 0
    for at, row in enumerate(block.rows):
        pairs = row.matches.pairs
        if len(pairs) and len(row.walls.ids):
            rows = np.minimum(np.searchsorted(row.walls.ids, pairs[:, 1]), len(row.walls.ids) - 1)
            known = row.walls.ids[rows] == pairs[:, 1]
            lines[first + pairs[known, 0]] = block.lines[block.walls_at(at)][rows[known]]
        first += len(row.segments)
    return lines
