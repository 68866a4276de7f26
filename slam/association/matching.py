"""Which wall of the map each segment of a scan belongs to (paper, section 2.1).

A chi-square gate on the joint covariance of the pose and the lines, an overlap along the line (so that the two walls
beside a door stay two), and the side from which each was seen (so that two faces of a thin wall stay two).
"""

from dataclasses import dataclass, field, replace
from functools import cached_property, partial
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import Joint, Observations
from ..estimation.gates import gate_level, pair_levels
from ..estimation.shared import SharedConfig, of_shared
from ..extraction.segments import Segments
from ..geometry.quantities import Angle, Distance, Factor, Probability
from .kernels.candidate_kernels import Candidates, Known, Limits, Seen
from .kernels.matching_kernels import matched, refused

MatchingMethod = Literal["joint", "paper"]


@dataclass(frozen=True)
class MatchingConfig:
    """How segments are associated with the walls of the map."""

    shared: SharedConfig = of_shared()
    method: MatchingMethod = "joint"
    """Associate all segments of a scan jointly, or each one alone by `gate` and `mission.mapper.shared.within_m` as in
    the paper."""
    gate: Probability = 0.99
    """Probability level of the chi-square gate; a match is unambiguous if every other wall has a cost higher by the
    gate's chi-square value."""
    angle_rad: Angle = 1.05
    """Segments and walls whose normals differ by more than this are never compared; those of a wall's two faces differ
    by pi."""
    beside_rad: Angle = 0.35
    """Largest angle between a short segment and the wall that it lies along, beyond the uncertainty of its
    direction."""
    one_wall: Probability = 0.9999
    """Probability level of the chi-square gate within which two walls of the map may be one, and are merged if they
    overlap."""
    overlap_m: Distance = 0.02
    """Smallest overlap of a segment and its wall along the line."""
    density: Factor = 0.1
    """Density of unmapped walls, per radian and metre: the higher it is, the sooner a segment outside the gate of the
    only wall in sight is a new wall."""

    @property
    def doubt(self) -> float:
        """Level up to which a wall is not ruled out: a segment of it is not made a wall, nor fused beyond the gate."""
        return 1.0 - self.shared.chance

    @cached_property
    def limits(self) -> Limits:
        """The numbers as the loops read them."""
        shared = self.shared
        return Limits(
            gate_level(self.gate, 2),
            gate_level(self.doubt, 2),
            gate_level(self.one_wall, 2),
            float(np.cos(self.angle_rad)),
            float(self.overlap_m),
            float(self.beside_rad),
            float(self.density),
            float(shared.beside_m),
            float(shared.short_m),
            float(shared.far_m),
        )


@dataclass(frozen=True)
class Matches:
    """Pairs of segment and wall."""

    pairs: Int[np.ndarray, "m 2"]
    """Rows (index of the segment, id of the wall)."""
    distances: Float[np.ndarray, " m"]
    """Squared Mahalanobis distance of each pair."""
    unmatched: Int[np.ndarray, " u"]
    """Indices of the segments that belong to no wall."""
    doubtful: Int[np.ndarray, " d"]
    """Those of the unmatched that lie too near a wall to be a new one."""
    refusals: dict[int, str]
    """For each unmatched segment with a wall near it, why that wall was refused."""
    ambiguous: Int[np.ndarray, " a"] = field(default_factory=partial(np.zeros, 0, dtype=np.int64))
    """Ids of walls along which an unmatched sure segment lies: it may show them."""

    def observations(self, segments: Segments) -> Observations:
        """Return the matched segments as observations of their walls."""
        rows = self.pairs[:, 0]
        return Observations(self.pairs[:, 1], segments.lines[rows], segments.cov[rows])


NO_MATCHES = Matches(
    np.zeros((0, 2), dtype=np.int64),
    np.zeros(0),
    np.zeros(0, dtype=np.int64),
    np.zeros(0, dtype=np.int64),
    {},
)


@dataclass(frozen=True)
class KnownWalls:
    """What matching needs of the walls near the robot, row by row."""

    ids: Int[np.ndarray, " n"]
    """Ascending."""
    extents: Float[np.ndarray, "n 2"]
    """From and to along the line, m from the anchor."""


def match(
    segments: Segments,
    walls: KnownWalls,
    joint: Joint,
    config: MatchingConfig = MatchingConfig(),
    *,
    clear_only: bool = False,
) -> Matches:
    """Match segments to the lines of `joint`, which are those of `walls` in the same order.

    With `clear_only`, keep only segments with one candidate that stands out, and of these only a jointly
    compatible set: what is safe enough to relocate the robot by. Why others were refused is not told then.
    """
    count, ids = len(segments), walls.ids
    if not len(ids) or not count:
        return replace(NO_MATCHES, unmatched=np.arange(count))
    limits, together = config.limits, pair_levels(config.doubt, count)
    seen = Seen(segments.lines, segments.cov, segments.ends, segments.is_tentative)
    known = Known(joint.mean, np.ascontiguousarray(joint.cov), joint.anchors, walls.extents)
    pairs, distances, doubtful, found = matched(seen, known, limits, together, clear_only)
    is_matched = np.zeros(count, dtype=bool)
    is_matched[pairs[:, 0]] = True
    pairs[:, 1] = ids[pairs[:, 1]]
    rest = pairs, distances, (~is_matched).nonzero()[0], (~is_matched & doubtful).nonzero()[0]
    if clear_only:
        return Matches(*rest, {})
    return Matches(
        *rest,
        {int(found.segment[pair]): why(found, pair, ids, limits) for pair in refused(found, is_matched).tolist()},
        along(found, ~is_matched & ~segments.is_tentative, ids, limits, config.shared.straight_rad),
    )


def along(
    found: Candidates,
    among: Bool[np.ndarray, " s"],
    ids: Int[np.ndarray, " n"],
    limits: Limits,
    straight_rad: float,
) -> Int[np.ndarray, " f"]:
    """Return the ids of walls along which some of these segments lie: they pass the gate, overlap, and hardly turn."""
    lies = (found.d2 <= limits.level) & (found.gap <= -limits.overlap_m) & (np.abs(found.e[:, 0]) < straight_rad)
    lines = found.line[lies & among[found.segment]]
    return np.unique(ids[lines]) if len(lines) else lines


def why(found: Candidates, pair: int, ids: Int[np.ndarray, " n"], limits: Limits) -> str:
    """Return why a candidate was refused."""
    wall, d2, gap = ids[found.line[pair]], found.d2[pair], found.gap[pair]
    if gap > -limits.overlap_m:
        return f"{max(gap, 0.0):.2f} m beyond the end of wall {wall}"
    if d2 > limits.level:
        return f"squared distance {d2:.1f} from wall {wall} (gate {limits.level:.1f})"
    return f"wall {wall} is not the only one that fits"
