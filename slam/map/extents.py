"""How far along its line each wall has been seen, how often, and whether it deserves trust."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import Belief
from ..extraction.segments import EndKind, Segments
from ..extraction.visible_extent import beam_spacing, owners_of_beams
from ..geometry.lines import directions
from ..geometry.poses import to_world
from ..robot import Scan
from .ray_evidence import Sightlines, sightlines
from .reliability import Firmness, FirmnessConfig
from .stochastic_map import StochasticMap


@dataclass(frozen=True)
class WallsConfig:
    """When a wall is trusted, and when it is forgotten."""

    trusted_sightings: int = 2
    """A wall is tentative until it was seen this often with enough beams."""
    patience_steps: int = 15
    """A tentative wall is forgotten after this many scans without a sighting."""
    firmness: FirmnessConfig = field(default_factory=FirmnessConfig)
    """Which sightings may move the estimate."""
    pass_margin_m: float = 0.1
    """A beam that goes on this far beyond a line has passed through it."""
    contradictions: int = 2
    """A wall is cut back once so many scans have shown beams passing through it."""
    end_margin_m: float = 0.1
    """Beams that pass this near to an end do not count: ends and corners are known no better."""
    least_m: float = 0.05
    """A wall cut back to less than this is forgotten."""
    claims: int = 6
    """A wall is forgotten when so many scans in turn gave all its beams to other walls ..."""
    established_sightings: int = 10
    """... unless it was seen at least this often."""


class Walls:
    """The extents of the walls of one map, in the order of the belief's ids; ids only ever grow."""

    def __init__(self, config: WallsConfig = WallsConfig()) -> None:
        self._config = config
        self._ids = np.zeros(0, dtype=np.int64)
        self._extents = np.zeros((0, 2))
        self._spacing = np.zeros((0, 2))
        self._sightings = np.zeros(0, dtype=np.int64)
        self._last_seen = np.zeros(0, dtype=np.int64)
        self._against = np.zeros(0, dtype=np.int64)
        self._overlaid = np.zeros((0, 2), dtype=np.int64)
        self._claimed = np.zeros(0, dtype=np.int64)
        self._firmness = Firmness(config.firmness)
        self._scans = 0

    def map(self, belief: Belief) -> StochasticMap:
        """Return the belief together with the extents."""
        tentative = self._sightings < self._config.trusted_sightings
        crooked = self._firmness.are_crooked(self._ids)
        return StochasticMap(belief, self._extents.copy(), self._sightings.copy(), tentative, crooked)

    def may_move(self, segments: Segments, ids: Int[np.ndarray, " s"]) -> Bool[np.ndarray, " s"]:
        """Return which segments, each on the wall of that id, may move the estimate (`firmness`)."""
        return self._firmness.may_move(segments, ids)

    def see(
        self,
        belief: Belief,
        scan: Scan,
        segments: Segments,
        owners: Int[np.ndarray, " s"],
        believed: Int[np.ndarray, " b"],
    ) -> Int[np.ndarray, " f"]:
        """Stretch the walls over the segments that they own, and return ids of walls not worth keeping.

        `believed` are walls that were seen often before they became walls.
        """
        self._scans += 1
        self._firmness.see(segments, owners, belief.pose_world)
        if len(belief.ids) > len(self._ids):
            self._append(belief.ids[len(self._ids) :])
        used = np.flatnonzero(owners >= 0)
        rows = np.searchsorted(self._ids, owners[used])
        self._stretch(belief, scan, segments, used, rows)
        self._uncover(belief, segments, owners, used, rows)
        self._sightings[np.unique(rows)] += 1
        seen_often = np.searchsorted(self._ids, believed)
        self._sightings[seen_often] = np.maximum(self._sightings[seen_often], self._config.trusted_sightings)
        self._last_seen[rows] = self._scans
        self._weigh(belief, scan, segments, owners)
        stale = self._scans - self._last_seen > self._config.patience_steps
        shaky = stale & (self._sightings < self._config.trusted_sightings)
        shaky |= (self._claimed >= self._config.claims) & (self._sightings < self._config.established_sightings)
        forgotten = self._ids[shaky | (self._extents[:, 1] - self._extents[:, 0] < self._config.least_m)]
        if len(forgotten):
            self.drop(forgotten)
            owners[np.isin(owners, forgotten)] = -1
        return forgotten

    def _weigh(self, belief: Belief, scan: Scan, segments: Segments, owners: Int[np.ndarray, " s"]) -> None:
        """Hold the walls against the beams: those that pass through them, and those that other walls account for."""
        near = np.flatnonzero(self.map(belief).distances_m < scan.range_max_m)
        anchors, means = belief.anchors[near], belief.means[near]
        lines = sightlines(scan, belief.pose_world, anchors, means, self._config.pass_margin_m)
        self._note_claims(near, lines, owners_of_beams(segments, owners, len(scan.bearings_rad)))
        self._cut_back(near, lines)

    def _note_claims(
        self, near: Int[np.ndarray, " n"], lines: Sightlines, owners_of_beams: Int[np.ndarray, " k"]
    ) -> None:
        """Count for how many scans in turn every beam on a wall has been some other wall's."""
        low, high = self._extents[near, :1], self._extents[near, 1:]
        on = lines.hits & (lines.along > low) & (lines.along < high)
        others = on & (owners_of_beams >= 0) & (owners_of_beams != self._ids[near, None])
        count = np.count_nonzero(on, axis=1)
        claimed = (count >= 4) & (np.count_nonzero(others, axis=1) >= 0.8 * count)
        seen = self._last_seen[near] == self._scans
        self._claimed[near] = np.where(seen, 0, self._claimed[near] + claimed)

    def _cut_back(self, near: Int[np.ndarray, " n"], lines: Sightlines) -> None:
        """Cut walls back where beams pass through them in scan after scan: a door, or a wall that never was."""
        margin = self._config.end_margin_m
        inside = (lines.along > self._extents[near, :1] + margin) & (lines.along < self._extents[near, 1:] - margin)
        passed = np.count_nonzero(lines.passes & inside, axis=1) >= 2
        self._against[near] = np.where(passed, self._against[near] + 1, 0)
        for k in np.flatnonzero(self._against[near] >= self._config.contradictions):
            row = near[k]
            through, on = lines.along[k, lines.passes[k] & inside[k]], lines.along[k, lines.hits[k] & inside[k]]
            kept = _kept_piece(self._extents[row], through, on)
            cut = kept != self._extents[row]
            self._extents[row] = kept
            self._spacing[row] = np.where(cut, self._config.end_margin_m, self._spacing[row])
            self._against[row] = 0

    def merge(self, belief: Belief, keep: int, drop: int) -> None:
        """Give `keep` the extent of both; call it before the back end merges them."""
        row, other = np.searchsorted(self._ids, [keep, drop])
        belief_row, belief_other = belief.rows([keep, drop])
        t = directions(belief.means[belief_row, 0])
        shift = t @ (belief.anchors[belief_other] - belief.anchors[belief_row])
        theirs = self._extents[other] + shift
        for side, outward in enumerate((-1.0, 1.0)):
            if outward * (theirs[side] - self._extents[row, side]) > 0:
                self._extents[row, side] = theirs[side]
                self._spacing[row, side] = self._spacing[other, side]
        self._sightings[row] += self._sightings[other]
        self._last_seen[row] = max(self._last_seen[row], self._last_seen[other])
        self.drop(np.array([drop]))

    def meet(self, pairs: Int[np.ndarray, "k 2"], along: Float[np.ndarray, "k 2"]) -> None:
        """End the walls of each pair of ids, the one before the other, so far along each, m, where they reach past."""
        before, after = np.searchsorted(self._ids, pairs).T
        np.minimum.at(self._extents[:, 1], before, along[:, 0])
        np.maximum.at(self._extents[:, 0], after, along[:, 1])

    def _append(self, ids: Int[np.ndarray, " m"]) -> None:
        m = len(ids)
        self._ids = np.concatenate([self._ids, ids])
        self._extents = np.concatenate([self._extents, np.tile([np.inf, -np.inf], (m, 1))])
        self._spacing = np.concatenate([self._spacing, np.full((m, 2), np.inf)])
        self._sightings = np.concatenate([self._sightings, np.zeros(m, dtype=np.int64)])
        self._last_seen = np.concatenate([self._last_seen, np.full(m, self._scans)])
        self._against = np.concatenate([self._against, np.zeros(m, dtype=np.int64)])
        self._overlaid = np.concatenate([self._overlaid, np.zeros((m, 2), dtype=np.int64)])
        self._claimed = np.concatenate([self._claimed, np.zeros(m, dtype=np.int64)])

    def drop(self, ids: Int[np.ndarray, " m"]) -> None:
        """Forget walls of these ids; they must be in the map."""
        kept = ~np.isin(self._ids, ids)
        self._ids, self._extents, self._spacing = self._ids[kept], self._extents[kept], self._spacing[kept]
        self._sightings, self._overlaid = self._sightings[kept], self._overlaid[kept]
        self._last_seen, self._against, self._claimed = self._last_seen[kept], self._against[kept], self._claimed[kept]

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
        along = np.vecdot(ends_world - belief.anchors[rows][:, None], t[:, None])
        spacing = beam_spacing(scan, segments)[used]
        corner = segments.end_kinds[used] == EndKind.CORNER
        for side, outward in enumerate((-1.0, 1.0)):
            for k, row in enumerate(rows):
                beyond = outward * (along[k, side] - self._extents[row, side])
                sharper = corner[k, side] and spacing[k, side] < self._spacing[row, side]
                if beyond > 0 or (sharper and -beyond < self._spacing[row, side]):
                    self._extents[row, side] = along[k, side]
                    self._spacing[row, side] = spacing[k, side]

    def _uncover(
        self,
        belief: Belief,
        segments: Segments,
        owners: Int[np.ndarray, " s"],
        used: Int[np.ndarray, " m"],
        rows: Int[np.ndarray, " m"],
    ) -> None:
        """Move an end back to the corner that scan after scan shows before it, if another wall runs on from there.

        From afar a wall that turns by a few degrees is taken for one straight wall, and so reaches past the corner.
        """
        ends_world = to_world(segments.ends, belief.pose_world)
        t, anchors = directions(belief.means[rows, 0]), belief.anchors[rows]
        is_corner = segments.end_kinds == EndKind.CORNER
        margin = self._config.end_margin_m
        for side, outward in enumerate((-1, 1)):
            after = (used + outward) % len(segments)
            corner, far = (np.vecdot(ends_world[k, side] - anchors, t) for k in (used, after))
            end = self._extents[rows, side]
            runs_on = is_corner[used, side] & is_corner[after, 1 - side] & (outward * (far - end) > -margin)
            others = (owners[after] >= 0) & (owners[after] != owners[used])
            overlaid = runs_on & others & (outward * (end - corner) > margin)
            scans = self._overlaid[rows, side] + 1
            self._overlaid[rows, side] = 0
            self._overlaid[rows[overlaid], side] = scans[overlaid]
            due = overlaid & (scans >= self._config.contradictions)
            self._extents[rows[due], side] = corner[due]
            self._spacing[rows[due], side] = margin


def _kept_piece(
    extent: Float[np.ndarray, "2"], through: Float[np.ndarray, " p"], on: Float[np.ndarray, " h"]
) -> Float[np.ndarray, "2"]:
    """Return the piece between passing beams that most beams end on (else the longest), cut back to its hits."""
    bounds = np.concatenate([extent[:1], np.sort(through), extent[1:]])
    hits, length = np.histogram(on, bounds)[0], np.diff(bounds)
    best = int(np.lexsort((length, hits))[-1])
    low, high = bounds[best], bounds[best + 1]
    inner = on[(on >= low) & (on <= high)]
    if len(inner) and best > 0 and inner.min() - low < 0.5:
        low = inner.min()
    if len(inner) and best < len(length) - 1 and high - inner.max() < 0.5:
        high = inner.max()
    return np.array([low, high])
