"""How far along its line each wall has been seen, how often, and whether it deserves trust."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from .backend import Belief
from .geometry.lines import directions
from .geometry.poses import to_world
from .models import reanchor
from .robot import Scan
from .segments import EndKind, Segments
from .stochastic_map import StochasticMap


@dataclass(frozen=True)
class WallsConfig:
    """When a wall is trusted, and when it is forgotten."""

    trusted_sightings: int = 2
    """A wall is tentative until it was seen this often with enough beams."""
    patience_steps: int = 15
    """A tentative wall is forgotten after this many scans without a sighting."""


class Walls:
    """The extents of the walls of one map, in the order of the belief's ids; ids only ever grow."""

    def __init__(self, config: WallsConfig = WallsConfig()) -> None:
        self._config = config
        self._ids = np.zeros(0, dtype=np.int64)
        self._extents = np.zeros((0, 2))
        self._spacing = np.zeros((0, 2))
        self._sightings = np.zeros(0, dtype=np.int64)
        self._last_seen = np.zeros(0, dtype=np.int64)
        self._scans = 0

    def extents(self, ids: Int[np.ndarray, " m"]) -> Float[np.ndarray, "m 2"]:
        """Return from and to along the line, m from the anchor."""
        return self._extents[np.searchsorted(self._ids, ids)]

    def map(self, belief: Belief) -> StochasticMap:
        """Return the belief together with the extents."""
        tentative = self._sightings < self._config.trusted_sightings
        return StochasticMap(belief, self._extents.copy(), self._sightings.copy(), tentative)

    def see(
        self, belief: Belief, scan: Scan, segments: Segments, owners: Int[np.ndarray, " s"]
    ) -> Int[np.ndarray, " f"]:
        """Stretch the walls over the segments that they own, and return ids of walls not worth keeping."""
        self._scans += 1
        self._append(belief.ids[len(self._ids) :])
        used = np.flatnonzero(owners >= 0)
        rows = np.searchsorted(self._ids, owners[used])
        self._stretch(belief, scan, segments, used, rows)
        self._sightings[np.unique(rows)] += 1
        self._last_seen[rows] = self._scans
        stale = self._scans - self._last_seen > self._config.patience_steps
        forgotten = self._ids[stale & (self._sightings < self._config.trusted_sightings)]
        self._drop(forgotten)
        return forgotten

    def merge(self, belief: Belief, keep: int, drop: int) -> None:
        """Give `keep` the extent of both; call it before the back end merges them."""
        row, other = np.searchsorted(self._ids, [keep, drop])
        belief_row, belief_other = belief.rows([keep, drop])
        t = directions(belief.means[belief_row, 0])
        moved, _ = reanchor(
            belief.means[belief_other], belief.anchors[belief_other], belief.anchors[belief_row]
        )
        del moved
        shift = t @ (belief.anchors[belief_other] - belief.anchors[belief_row])
        theirs = self._extents[other] + shift
        for side, outward in enumerate((-1.0, 1.0)):
            if outward * (theirs[side] - self._extents[row, side]) > 0:
                self._extents[row, side] = theirs[side]
                self._spacing[row, side] = self._spacing[other, side]
        self._sightings[row] += self._sightings[other]
        self._last_seen[row] = max(self._last_seen[row], self._last_seen[other])
        self._drop(np.array([drop]))

    def _append(self, ids: Int[np.ndarray, " m"]) -> None:
        m = len(ids)
        self._ids = np.concatenate([self._ids, ids])
        self._extents = np.concatenate([self._extents, np.tile([np.inf, -np.inf], (m, 1))])
        self._spacing = np.concatenate([self._spacing, np.full((m, 2), np.inf)])
        self._sightings = np.concatenate([self._sightings, np.zeros(m, dtype=np.int64)])
        self._last_seen = np.concatenate([self._last_seen, np.full(m, self._scans)])

    def _drop(self, ids: Int[np.ndarray, " m"]) -> None:
        kept = ~np.isin(self._ids, ids)
        self._ids, self._extents, self._spacing = self._ids[kept], self._extents[kept], self._spacing[kept]
        self._sightings, self._last_seen = self._sightings[kept], self._last_seen[kept]

    def _stretch(
        self,
        belief: Belief,
        scan: Scan,
        segments: Segments,
        used: Int[np.ndarray, " m"],
        rows: Int[np.ndarray, " m"],
    ) -> None:
        """Move the ends outwards to what was seen, and inwards where a corner was seen more sharply than before."""
        ends_world = to_world(segments.ends[used], belief.pose_world)
        t = directions(belief.means[rows, 0])
        along = np.sum((ends_world - belief.anchors[rows][:, None]) * t[:, None], axis=-1)
        spacing = beam_spacing(scan, segments)[used]
        corner = segments.end_kinds[used] == EndKind.CORNER
        for side, outward in enumerate((-1.0, 1.0)):
            for k, row in enumerate(rows):
                beyond = outward * (along[k, side] - self._extents[row, side])
                sharper = corner[k, side] and spacing[k, side] < self._spacing[row, side]
                if beyond > 0 or (sharper and -beyond < self._spacing[row, side]):
                    self._extents[row, side] = along[k, side]
                    self._spacing[row, side] = spacing[k, side]


def beam_spacing(scan: Scan, segments: Segments) -> Float[np.ndarray, "n 2"]:
    """Return the distance between neighbouring beams on the wall at each end of each segment, m."""
    step = (scan.bearings_rad[-1] - scan.bearings_rad[0]) / max(len(scan.bearings_rad) - 1, 1)
    distance = np.hypot(segments.ends[..., 0], segments.ends[..., 1])
    cosine = np.clip(segments.lines[:, 1, None] / np.maximum(distance, 1e-9), 0.05, 1.0)
    return step * distance / cosine
