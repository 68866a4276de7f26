"""How far along its line each wall has been seen, how often, and whether it deserves trust."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import Belief
from ..extraction.segments import EndKind, Segments
from ..extraction.visible_extent import beam_spacing, owners_of_beams
from ..geometry.lines import directions
from ..geometry.poses import to_world
from ..robot import RobotSpec, Scan, of_robot
from .ray_evidence import RayEvidence, ray_evidence
from .records import Merger, Records
from .reliability import ReliabilityConfig
from .stochastic_map import ESTABLISHED, StochasticMap

CLAIMED_BEAMS = 4
"""Fewer beams on a wall say nothing about whose they are."""
CLAIMED_SHARE = 0.8
"""A wall is claimed by others in a scan that gives them this share of its beams: a beam or two may lie near both."""
TRIM_M = 0.5
"""What is left of a wall that a beam passed through is cut back to its hits by less than this: beams stand apart."""


@dataclass(frozen=True)
class WallsConfig:
    """When a wall is trusted, and when it is forgotten."""

    robot: RobotSpec = of_robot()
    trusted_observations: int = 2
    """A wall is tentative until it was seen this often with enough beams."""
    patience_m: float = 2.25
    """A tentative wall is forgotten once it was not observed for the steps that so long a way takes."""
    reliability: ReliabilityConfig = field(default_factory=ReliabilityConfig)
    """Which observations may move the estimate."""
    contradictions: int = 2
    """A wall is cut back once so many scans have shown beams passing through it."""
    end_margin_m: float = 0.1
    """A beam that goes on this far beyond a line has passed through it; those that pass this near to an end do not
    count: ends and corners are known no better."""
    least_m: float = 0.05
    """A wall cut back to less than this is forgotten."""
    claims: int = 6
    """A wall is forgotten when so many scans in turn gave all its beams to other walls, unless it is established."""

    @property
    def patience_steps(self) -> int:
        """A tentative wall is forgotten after this many scans without an observation."""
        return self.robot.steps_of(self.patience_m)


class Extents:
    """How far each wall has been seen, and for how long; walls stand in the order of the belief's ids."""

    def __init__(self, config: WallsConfig = WallsConfig(), records: Records | None = None) -> None:
        self._config = config
        self._records = Records() if records is None else records
        self._scans = 0
        self._records.declare(
            self._merge,
            extents=np.array([np.inf, -np.inf]),
            spacing=np.full(2, np.inf),
            observations=0,
            last_seen=0,
            against=0,
            claimed=0,
            whole=0,
        )

    def map(self, belief: Belief, crooked: Bool[np.ndarray, " n"]) -> StochasticMap:
        """Return the belief together with the extents."""
        extents, observations = (self._records.columns[name] for name in ("extents", "observations"))
        tentative = observations < self._config.trusted_observations
        whole = self._records.columns["whole"] >= self._config.trusted_observations
        return StochasticMap(belief, extents.copy(), observations.copy(), tentative, crooked, whole)

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
        used = np.flatnonzero(owners >= 0)
        rows, seen_often = self._records.rows(owners[used]), self._records.rows(believed)
        columns = self._records.columns
        before = columns["extents"].copy()
        self._stretch(belief, scan, segments, used, rows)
        self._note_whole(before, segments, used, rows)
        observations, last_seen, extents = (columns[name] for name in ("observations", "last_seen", "extents"))
        observations[np.unique(rows)] += 1
        observations[seen_often] = np.maximum(observations[seen_often], self._config.trusted_observations)
        last_seen[rows] = self._scans
        self._weigh(belief, scan, segments, owners)
        stale = self._scans - last_seen > self._config.patience_steps
        shaky = stale & (observations < self._config.trusted_observations)
        shaky |= (columns["claimed"] >= self._config.claims) & (observations < ESTABLISHED)
        return self._records.ids[shaky | (extents[:, 1] - extents[:, 0] < self._config.least_m)]

    def _note_whole(
        self,
        before: Float[np.ndarray, "n 2"],
        segments: Segments,
        used: Int[np.ndarray, " m"],
        rows: Int[np.ndarray, " m"],
    ) -> None:
        """Count in how many scans nothing hid either end of a wall, since it last turned out to be longer."""
        extents, whole = self._records.columns["extents"], self._records.columns["whole"]
        with np.errstate(invalid="ignore"):
            grown = np.abs(extents - before).max(axis=1) > self._config.end_margin_m
        whole[grown] = 0
        np.add.at(whole, rows, (segments.end_kinds[used] != EndKind.OCCLUDED).all(axis=1))

    def _weigh(self, belief: Belief, scan: Scan, segments: Segments, owners: Int[np.ndarray, " s"]) -> None:
        """Hold the walls against the beams: those that pass through them, and those that other walls account for."""
        walls = self.map(belief, np.zeros(len(self._records), dtype=bool))
        near = np.flatnonzero(walls.distances_m < scan.range_max_m)
        anchors, means = belief.anchors[near], belief.means[near]
        lines = ray_evidence(scan, belief.pose_world, anchors, means, self._config.end_margin_m)
        self._note_claims(near, lines, owners_of_beams(segments, owners, len(scan.bearings_rad)))
        self._cut_back(near, lines)

    def _note_claims(
        self, near: Int[np.ndarray, " n"], lines: RayEvidence, owners_of_beams: Int[np.ndarray, " k"]
    ) -> None:
        """Count for how many scans in turn every beam on a wall has been some other wall's."""
        extents, last_seen, scans = (self._records.columns[name] for name in ("extents", "last_seen", "claimed"))
        low, high = extents[near, :1], extents[near, 1:]
        on = lines.hits & (lines.along > low) & (lines.along < high)
        others = on & (owners_of_beams >= 0) & (owners_of_beams != self._records.ids[near, None])
        count = np.count_nonzero(on, axis=1)
        claimed = (count >= CLAIMED_BEAMS) & (np.count_nonzero(others, axis=1) >= CLAIMED_SHARE * count)
        seen = last_seen[near] == self._scans
        scans[near] = np.where(seen, 0, scans[near] + claimed)

    def _cut_back(self, near: Int[np.ndarray, " n"], lines: RayEvidence) -> None:
        """Cut walls back where beams pass through them in scan after scan: a door, or a wall that never was."""
        extents, spacing, against = (self._records.columns[name] for name in ("extents", "spacing", "against"))
        margin = self._config.end_margin_m
        inside = (lines.along > extents[near, :1] + margin) & (lines.along < extents[near, 1:] - margin)
        passed = np.count_nonzero(lines.passes & inside, axis=1) >= 2
        against[near] = np.where(passed, against[near] + 1, 0)
        for k in np.flatnonzero(against[near] >= self._config.contradictions):
            row = near[k]
            through, on = lines.along[k, lines.passes[k] & inside[k]], lines.along[k, lines.hits[k] & inside[k]]
            kept = _kept_piece(extents[row], through, on)
            cut = kept != extents[row]
            extents[row] = kept
            spacing[row] = np.where(cut, self._config.end_margin_m, spacing[row])
            against[row] = 0

    def _merge(self, merger: Merger) -> None:
        """Give the kept wall the extent of both."""
        columns, row, other = self._records.columns, merger.keep, merger.drop
        extents, spacing = columns["extents"], columns["spacing"]
        theirs = extents[other] + merger.shift_m
        for side, outward in enumerate((-1.0, 1.0)):
            if outward * (theirs[side] - extents[row, side]) > 0:
                extents[row, side] = theirs[side]
                spacing[row, side] = spacing[other, side]
        columns["observations"][row] += columns["observations"][other]
        columns["whole"][row] = 0
        columns["last_seen"][row] = max(columns["last_seen"][row], columns["last_seen"][other])

    def meet(self, pairs: Int[np.ndarray, "k 2"], along: Float[np.ndarray, "k 2"]) -> None:
        """End the walls of each pair of ids, the one before the other, so far along each, m, where they reach past."""
        before, after = self._records.rows(pairs[:, 0]), self._records.rows(pairs[:, 1])
        extents = self._records.columns["extents"]
        np.minimum.at(extents[:, 1], before, along[:, 0])
        np.maximum.at(extents[:, 0], after, along[:, 1])

    def _stretch(
        self,
        belief: Belief,
        scan: Scan,
        segments: Segments,
        used: Int[np.ndarray, " m"],
        rows: Int[np.ndarray, " m"],
    ) -> None:
        """Move the ends outwards to what was seen, and inwards where a corner was seen more sharply than before."""
        extents, spacing = (self._records.columns[name] for name in ("extents", "spacing"))
        ends_world = to_world(segments.ends[used], belief.pose_world)
        t = directions(belief.means[rows, 0])
        along = np.vecdot(ends_world - belief.anchors[rows][:, None], t[:, None])
        apart = beam_spacing(scan, segments)[used]
        corner = segments.end_kinds[used] == EndKind.CORNER
        for side, outward in enumerate((-1.0, 1.0)):
            for k, row in enumerate(rows):
                beyond = outward * (along[k, side] - extents[row, side])
                sharper = corner[k, side] and apart[k, side] < spacing[row, side]
                if beyond > 0 or (sharper and -beyond < spacing[row, side]):
                    extents[row, side] = along[k, side]
                    spacing[row, side] = apart[k, side]


def _kept_piece(
    extent: Float[np.ndarray, "2"], through: Float[np.ndarray, " p"], on: Float[np.ndarray, " h"]
) -> Float[np.ndarray, "2"]:
    """Return the piece between passing beams that most beams end on (else the longest), cut back to its hits."""
    bounds = np.concatenate([extent[:1], np.sort(through), extent[1:]])
    hits, length = np.histogram(on, bounds)[0], np.diff(bounds)
    best = int(np.lexsort((length, hits))[-1])
    low, high = bounds[best], bounds[best + 1]
    inner = on[(on >= low) & (on <= high)]
    if len(inner) and best > 0 and inner.min() - low < TRIM_M:
        low = inner.min()
    if len(inner) and best < len(length) - 1 and high - inner.max() < TRIM_M:
        high = inner.max()
    return np.array([low, high])
