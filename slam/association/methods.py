"""The ways to match: one file each, and one line in the registry."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol, runtime_checkable

from ..estimation.backend import Joint
from ..extraction.segments import Segments
from .joint_compatibility import JointObservations, relocate
from .matching import KnownWalls, Matches, MatchingConfig, MatchingMethod, match
from .paper_matching import match_alone, relocate_robot


@runtime_checkable
class Matcher(Protocol):
    """Tells which wall each segment of a scan belongs to; an oracle may take its place."""

    def __call__(
        self, segments: Segments, walls: KnownWalls, joint: Joint, config: MatchingConfig, *, clear_only: bool = False
    ) -> Matches:
        """Return the matches by the joint Gaussian of the pose and these walls; `clear_only`: those beyond doubt."""
        ...


@dataclass(frozen=True)
class Method:
    """How steps 2, 3 and 4 of the paper are taken."""

    matcher: Matcher
    relocate: Callable[[Joint, JointObservations], Joint]
    """What is known once the robot is localised, to match again."""
    clear_stay: bool
    """Whether the first matches stand, and only the other segments are matched again."""
    looks_near: bool = True
    """Whether a segment is never of a wall that lies far from it; an oracle may know better."""


METHODS: dict[MatchingMethod, Method] = {
    "joint": Method(match, relocate, True),
    "paper": Method(match_alone, relocate_robot, False),
}
"""By the name in `MatchingConfig.method`."""
