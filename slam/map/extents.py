"""How far along its line each wall has been seen, how often, and whether it deserves trust."""

from collections.abc import Mapping
from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import Belief
from ..estimation.shared import SharedConfig, of_shared
from ..extraction.segments import Segments
from ..robot import Scan
from .displacement import along
from .existence import JUST_BEGUN, ExistenceConfig
from .kernels import wall_kernels
from .kernels.existence_kernels import look
from .kernels.extent_kernels import contradict, take_in
from .records import Merger, Records
from .reliability import ReliabilityConfig
from .stochastic_map import StochasticMap

NOBODY = np.zeros(0, dtype=np.int64)
"""Ids of no walls."""
NO_ODDS: Mapping[int, float] = {}
"""No walls begin more likely than others."""


@dataclass(frozen=True)
class WallsConfig:
    """How walls are confirmed, cut back and removed.

    A wall is cut back once two scans in turn show a beam that passes through it: one that reaches beyond it by a wall's
    thickness and crosses it as far from its ends, or in its middle half. What is left is removed once it is shorter
    than the accuracy of its ends, so that objects that stood there for a while disappear from the map.
    """

    shared: SharedConfig = of_shared()
    existence: ExistenceConfig = field(default_factory=ExistenceConfig)
    """A wall is tentative until it is likely enough to exist, and removed once it is likelier not to."""
    reliability: ReliabilityConfig = field(default_factory=ReliabilityConfig)
    """It inflates the stated covariance."""
    housekeeping: bool = True
    """Prune the map: cut walls back where beams pass through them, and remove walls that no longer exist."""


class Extents:
    """How far each wall has been seen, and for how long; walls stand in the order of the belief's ids."""

    def __init__(self, config: WallsConfig, records: Records, sure_beams: int) -> None:
        """Keep the extents in these records; `sure_beams` are those of a sure segment."""
        self._config = config
        self._odds, self._believed = config.existence.odds(sure_beams), config.existence.believed
        self._records = records
        self._records.declare(
            self._merge,
            extents=np.array([np.inf, -np.inf]),
            placed=np.full(2, np.nan),
            spacing=np.full(2, np.inf),
            observations=0,
            against=0,
            log_odds=self._believed,
            place=JUST_BEGUN,
        )

    def follow(self, belief: Belief) -> None:
        """Move extents along with the map, where long walls have moved by more than ends are known to."""
        columns, shared = self._records.columns, self._config.shared
        self._records.rows(belief.ids)
        placed, extents, long_m = columns["placed"], columns["extents"], float(shared.long_m)
        tell, ends_world, moved_m = wall_kernels.moved(placed, extents, belief.anchors, belief.means, long_m)
        if not len(tell) or np.abs(moved_m).max() <= shared.resolution_m:
            return
        seen = np.flatnonzero(extents[:, 0] <= extents[:, 1])
        middles = wall_kernels.ends_world(belief.anchors[seen], placed[seen], extents[seen]).mean(axis=1)
        extents[seen] += along(middles, placed[seen, 0], ends_world, placed[tell, 0], moved_m, long_m)[:, None]
        placed[:] = belief.means

    def map(
        self,
        belief: Belief,
        crooked: Bool[np.ndarray, " n"],
        off_line_cov: Float[np.ndarray, "n 2 2"] | None = None,
    ) -> StochasticMap:
        """Return the belief together with the extents, and how far walls may be from their lines."""
        columns = self._records.columns
        extents, observations = columns["extents"].copy(), columns["observations"].copy()
        tentative = columns["log_odds"] <= self._believed
        return StochasticMap(belief, extents, observations, tentative, crooked, off_line_cov)

    def meet(self, pairs: Int[np.ndarray, "k 2"], along: Float[np.ndarray, "k 2"]) -> None:
        """End the walls of each pair of ids, the one before the other, so far along each, m, where they reach past.

        A wall of which that would leave less than ends are accurate stays as it is.
        """
        before, after = self._records.rows(pairs[:, 0]), self._records.rows(pairs[:, 1])
        extents = self._records.columns["extents"]
        ended = extents.copy()
        np.minimum.at(ended[:, 1], before, along[:, 0])
        np.maximum.at(ended[:, 0], after, along[:, 1])
        is_left = ended[:, 1] - ended[:, 0] >= self._config.shared.resolution_m
        extents[is_left] = ended[is_left]

    def see(
        self,
        belief: Belief,
        scan: Scan,
        segments: Segments,
        rows: Int[np.ndarray, " s"],
        begun: Mapping[int, float] = NO_ODDS,
        ambiguous: Int[np.ndarray, " a"] = NOBODY,
    ) -> Int[np.ndarray, " f"]:
        """Stretch the walls over the segments that they own, and return ids of walls not worth keeping.

        `rows` holds the row of each segment's wall, -1 for none, and `begun` ids of walls that begin more likely than
        others, and their log odds; the scan may show `ambiguous` ones, too.
        """
        columns, shared, margin_m = self._records.columns, self._config.shared, float(self._config.shared.thickness_m)
        extents, spacing, log_odds = columns["extents"], columns["spacing"], columns["log_odds"]
        seen, lines = (segments.ends, segments.lines, segments.at_corner, rows), (belief.anchors, belief.means)
        kept = extents, spacing, columns["observations"]
        shown = take_in(*seen, belief.pose_world, *lines, scan.step_rad, *kept)
        beams = np.zeros(len(extents), dtype=np.int64)
        if self._config.housekeeping:
            rays = scan.bearings_rad, scan.ranges_m, scan.passed_m, float(scan.range_max_m), belief.pose_world, *lines
            rules = self._odds.margin_m, margin_m, float(shared.far_m), shared.scans
            beams = contradict(*rays, extents, spacing, columns["against"], *rules)
            if len(ambiguous):
                beams[np.isin(self._records.ids, ambiguous)] = 0
        look(belief.pose_world, beams, shown, log_odds, columns["place"], self._odds)
        if begun:
            begins = self._records.rows(np.array(list(begun), dtype=np.int64))
            log_odds[begins] = np.maximum(log_odds[begins], list(begun.values()))
        if not self._config.housekeeping:
            return NOBODY
        return self._records.ids[(log_odds < 0.0) | (extents[:, 1] - extents[:, 0] < shared.resolution_m)]

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
        columns["log_odds"][row] = max(columns["log_odds"][row], columns["log_odds"][other])
