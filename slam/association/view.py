"""One scan beside the walls that it can show: matched, used to localise, and matched again (paper, section 2.2)."""

from dataclasses import dataclass
from typing import Protocol, runtime_checkable

import numpy as np

from ..estimation.backend import Joint, Observations
from ..extraction.segments import Segments
from .joint_compatibility import relocate
from .matching import KnownWalls, Matches, MatchingConfig


@runtime_checkable
class Matcher(Protocol):
    """Tells which wall each segment of a scan belongs to; an oracle may take its place."""

    def __call__(
        self, segments: Segments, walls: KnownWalls, joint: Joint, config: MatchingConfig, *, clear_only: bool = False
    ) -> Matches:
        """Return the matches by the joint Gaussian of the pose and these walls; `clear_only`: those beyond doubt."""
        ...


@dataclass(frozen=True)
class View:
    """All that matching is told of one scan."""

    segments: Segments
    walls: KnownWalls
    joint: Joint
    """Of the pose and these walls, before the scan."""
    matcher: Matcher
    config: MatchingConfig

    def match_clear(self) -> Matches:
        """Return the matches that are beyond doubt."""
        return self.matcher(self.segments, self.walls, self.joint, self.config, clear_only=True)

    def match_all(self) -> Matches:
        """Return all matches, from the pose before the scan."""
        return self.matcher(self.segments, self.walls, self.joint, self.config)

    def localised(self, first: Observations) -> Joint:
        """Return pose and walls as they are known once some walls were observed."""
        return relocate(self.joint, self.walls.ids, first)

    def match_rest(self, clear: Matches, relocated: Joint) -> Matches:
        """Return the clear matches together with those of the remaining segments from the new pose."""
        rest = clear.unmatched
        again = self.matcher(self.segments.take(rest), self.walls, relocated, self.config)
        more = again.pairs.copy()
        more[:, 0] = rest[more[:, 0]]
        return Matches(
            np.concatenate([clear.pairs, more]),
            np.concatenate([clear.distances, again.distances]),
            rest[again.unmatched],
            rest[again.doubtful],
            np.column_stack([rest[again.ambiguous[:, 0]], again.ambiguous[:, 1:]]),
            {int(rest[k]): why for k, why in again.refusals.items()},
        )
