"""All that is known of the walls of one map beside their lines: observed, merged and removed in one place."""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import Belief
from ..extraction.segments import Segments
from ..geometry.lines import directions
from ..robot import Scan
from .extents import NO_ODDS, NOBODY, Extents, WallsConfig
from .kernels.reliability_kernels import lack_of_fit
from .profiles import Profiles
from .records import Records
from .reliability import Reliability
from .stochastic_map import StochasticMap


@dataclass(frozen=True)
class Observed:
    """What one scan says of the walls."""

    owners: Int[np.ndarray, " s"]
    """For each segment the id of its wall, -1 for none."""
    forgotten: Int[np.ndarray, " f"]
    """Ids of walls that are not worth keeping; their records have ended."""


class Landmarks:
    """The records of the walls in a back end's map, a row each, in the order of the belief's ids."""

    def __init__(self, walls: WallsConfig, sure_beams: int) -> None:
        """`sure_beams` are those of a sure segment."""
        self.records = Records()
        self.extents = Extents(walls, self.records, sure_beams)
        self.reliability = Reliability(walls.reliability, self.records)
        self.profiles = Profiles(walls.shared, self.records)

    def map(self, belief: Belief) -> StochasticMap:
        """Return the belief together with what is known of its walls."""
        columns = self.records.columns
        return self.extents.map(belief, *self.reliability.off_line_cov(columns["extents"], columns["broken"]))

    def lack_of_fit(self, segments: Segments, owners: Int[np.ndarray, " s"]) -> Float[np.ndarray, "s 2 2"]:
        """Return how far the face that each segment shows may be from the line of its wall, of (alpha rad, r m)."""
        rows, columns = self.records.rows(owners), self.records.columns
        return lack_of_fit(segments.lines, segments.ends, columns["broken"][rows], columns["extents"][rows])

    def observe(
        self,
        belief: Belief,
        scan: Scan,
        segments: Segments,
        owners: Int[np.ndarray, " s"],
        begun: Mapping[int, float] = NO_ODDS,
        ambiguous: Int[np.ndarray, " a"] = NOBODY,
    ) -> Observed:
        """Take in one scan, of which `owners` holds the wall of each segment, those of new walls among them.

        `begun` holds ids of walls that begin more likely than others, and their log odds; the scan may show
        `ambiguous` ones, too.
        """
        self.records.rows(belief.ids)
        rows = self.records.rows(owners)
        self.reliability.see(segments, rows)
        self.profiles.see(belief, scan, segments, rows)
        forgotten = self.extents.see(belief, scan, segments, rows, begun, ambiguous)
        if not len(forgotten):
            return Observed(owners, forgotten)
        self.records.remove(forgotten)
        return Observed(np.where(np.isin(owners, forgotten), -1, owners), forgotten)

    def merge(self, belief: Belief, keep: int, drop: int) -> None:
        """Make one record of two walls that are one; call it before the back end merges them."""
        row, other = belief.rows([keep, drop])
        shift = directions(belief.means[row, 0]) @ (belief.anchors[other] - belief.anchors[row])
        self.records.merge(keep, drop, float(shift))

    def remove(self, ids: Int[np.ndarray, " n"]) -> None:
        """End the records of walls that are none."""
        self.records.remove(ids)
