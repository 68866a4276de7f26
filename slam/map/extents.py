"""How far along its line each wall has been seen, how often, and whether it deserves trust."""

from dataclasses import dataclass, field
from sys import maxsize

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import Belief
from ..estimation.shared import SharedConfig, of_shared
from ..extraction.segments import Segments
from ..extraction.visible_extent import owners_of_beams
from ..robot import RobotSpec, Scan, of_robot
from .kernels.extent_kernels import take_in, weigh
from .records import Merger, Records
from .reliability import ReliabilityConfig
from .stochastic_map import ESTABLISHED, StochasticMap

NOBODY = np.zeros(0, dtype=np.int64)
"""Ids of no walls."""


@dataclass(frozen=True)
class WallsConfig:
    """When a wall is trusted, and when it is forgotten.

    A wall is tentative until two scans saw it with enough beams, and cut back once two in turn have shown beams passing
    through it: beams that go on beyond it by a wall's thickness, and as far from its ends. A wall cut back to less than
    ends are known to is forgotten.
    """

    robot: RobotSpec = of_robot()
    shared: SharedConfig = of_shared()
    patience_m: float = 2.25
    """A tentative wall is forgotten once it was not observed for the steps that so long a way takes."""
    reliability: ReliabilityConfig = field(default_factory=ReliabilityConfig)
    """How far walls may be off the lines that stand for them."""
    claims: int = 6
    """A wall is forgotten when so many scans in turn gave all its beams to other walls, unless it is established."""
    housekeeping: bool = True
    """Whether walls are cut back and forgotten; where it is known whose each segment is, nothing needs mending."""

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
            overlaid=np.zeros(2, dtype=np.int64),
            against=0,
            claimed=0,
            whole=0,
        )

    def map(
        self,
        belief: Belief,
        crooked: Bool[np.ndarray, " n"],
        off_line_cov: Float[np.ndarray, "n 2 2"] | None = None,
    ) -> StochasticMap:
        """Return the belief together with the extents, and how far walls may be from their lines."""
        extents, observations = (self._records.columns[name] for name in ("extents", "observations"))
        tentative = observations < self._config.shared.scans
        whole = self._records.columns["whole"] >= self._config.shared.scans
        return StochasticMap(belief, extents.copy(), observations.copy(), tentative, crooked, whole, off_line_cov)

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
        columns, shared = self._records.columns, self._config.shared
        scans = shared.scans if self._config.housekeeping else maxsize
        extents, lines = columns["extents"], (belief.pose_world, belief.anchors, belief.means)
        seen = segments.ends, segments.lines, segments.end_kinds, owners, used, rows
        kept = extents, columns["spacing"], columns["whole"], columns["overlaid"]
        take_in(*seen, *lines, scan.step_rad, *kept, float(shared.thickness_m), scans)
        observations, last_seen = columns["observations"], columns["last_seen"]
        observations[rows] += 1  # of a wall with two segments, too, by one: the sum is taken before it is stored
        observations[seen_often] = np.maximum(observations[seen_often], shared.scans)
        last_seen[rows] = self._scans
        if not self._config.housekeeping:
            return NOBODY
        self._weigh(belief, scan, segments, owners)
        stale = self._scans - last_seen > self._config.patience_steps
        shaky = stale & (observations < shared.scans)
        shaky |= (columns["claimed"] >= self._config.claims) & (observations < ESTABLISHED)
        return self._records.ids[shaky | (extents[:, 1] - extents[:, 0] < shared.resolution_m)]

    def _weigh(self, belief: Belief, scan: Scan, segments: Segments, owners: Int[np.ndarray, " s"]) -> None:
        """Hold the walls against the beams: those that pass through them, and those that other walls account for."""
        columns, shared = self._records.columns, self._config.shared
        beams = scan.bearings_rad, scan.ranges_m, scan.passed_m
        owners = owners_of_beams(segments, owners, len(scan.bearings_rad))
        lines = belief.pose_world, belief.anchors, belief.means, self._records.ids
        kept = columns["extents"], columns["spacing"], columns["claimed"], columns["against"]
        limits = float(shared.thickness_m), float(shared.far_m), shared.scans
        seen = columns["last_seen"] == self._scans
        weigh(float(scan.range_max_m), *beams, owners, *lines, seen, *kept, *limits)

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
