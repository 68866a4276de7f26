"""Which wall of the map each segment of a scan belongs to (paper, section 2.1).

A chi-square gate on the joint covariance of the pose and the lines, an overlap along the line (so that the two walls
beside a door stay two), and the side from which each was seen (so that two faces of a thin wall stay two).
"""

from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import Joint, Observations
from ..estimation.gates import gate_level
from ..estimation.models import Innovations, halfway, innovations
from ..extraction.segments import Segments
from ..geometry.lines import directions
from ..geometry.poses import to_world
from .hypotheses import agree, nearest_alone
from .joint_compatibility import compatible, squared_distances, taken_together

MatchingMethod = Literal["joint", "paper"]
OVERLAP_SHARE = 0.5
"""A short segment lies along a wall that covers at least this share of it."""


@dataclass(frozen=True)
class MatchingConfig:
    """When a segment and a wall are one."""

    method: MatchingMethod = "joint"
    """All segments of a scan together, or each alone as in the paper, by `gate` and `apart_m` only (`methods`)."""
    gate: float = 0.99
    """Probability level of the chi-square gate."""
    doubt: float = 0.999999
    """A segment beyond the gate but within this level of a wall that it overlaps is neither fused nor made a wall."""
    angle_rad: float = 1.05
    """Normals that differ by more than this are never compared (the other side of a wall differs by pi)."""
    offset_m: float = 0.5
    """Nor are lines that stand further apart than this at the seen piece, unless the robot is as lost as that."""
    overlap_m: float = 0.02
    """A segment and its wall overlap along the line by at least this: two rooms' walls on one line stand no farther
    apart than a wall is thick."""
    short_m: float = 0.3
    """Shorter segments are too poor in direction for the gate alone: they are in doubt also beside a wall."""
    beside_m: float = 0.08
    """Distance from a wall, across it, within which a short segment of which it covers half is not a new wall."""
    beside_rad: float = 0.35
    """Largest difference in direction, beyond three sigmas of the short segment's, for the same."""
    density: float = 0.1
    """Walls that nobody has seen, per radian of direction and metre of offset: five in sight of 4 m. The only wall in
    sight is matched beyond the gate too where a new one would be less likely."""
    one_wall: float = 0.9999
    """Probability level within which two landmarks of the map may be one wall, so that either will do; where they lie
    along each other they are made one. One true pair in 10,000 is refused, and stays, since each observation goes to
    the landmark that it fits better, which keeps them apart."""
    clear: float = 9.0
    """A match is clear when any other wall would cost so much more (squared Mahalanobis distance)."""
    whole_m: float = 0.2
    """A short wall of which both ends were seen is none of which a segment shows more by this: a face beside it, or a
    step behind it, passes the gate of a direction that is hardly known."""
    apart_m: float = 0.3
    """Of method `paper`: largest distance between a segment and its wall, half the width of a narrow door."""


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
    whole: Bool[np.ndarray, " n"] | None = None
    """Walls that are known to reach no farther; None where that is not known of any."""


@dataclass(frozen=True)
class _Candidates:
    """Pairs of segment and line that may be one, with what the filter says of each."""

    segment: Int[np.ndarray, " c"]
    line: Int[np.ndarray, " c"]
    model: Innovations
    d2: Float[np.ndarray, " c"]
    gap: Float[np.ndarray, " c"]
    """Distance along the line between segment and wall, m; negative where they overlap by that much."""


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
    compatible set: what is safe enough to relocate the robot by.
    """
    count = len(segments)
    ids = walls.ids
    if not len(ids) or not count:
        return replace(NO_MATCHES, unmatched=np.arange(count))
    found = _candidates(segments, walls, joint, config)
    level = gate_level(config.gate, 2)
    covers = found.gap <= -config.overlap_m
    if clear_only:
        chosen = _agreed(found, np.flatnonzero(covers), segments, joint, config)
        chosen = _still_overlapping(chosen, found, segments, walls, joint, config)
    else:
        chosen = _nearest(found, np.flatnonzero(covers & (found.d2 <= level)), joint, config)
    matched = np.zeros(count, dtype=bool)
    matched[found.segment[chosen]] = True
    beside = _is_beside(found, segments, config)
    doubt = beside | ((found.d2 <= gate_level(config.doubt, 2)) & (found.gap <= 0.0))
    doubtful = np.zeros(count, dtype=bool)
    doubtful[found.segment[doubt]] = True
    return Matches(
        np.stack([found.segment[chosen], ids[found.line[chosen]]], axis=-1),
        found.d2[chosen],
        np.flatnonzero(~matched),
        np.flatnonzero(~matched & doubtful),
        _refusals(found, ids, ~matched, level, config),
    )


def _candidates(segments: Segments, walls: KnownWalls, joint: Joint, config: MatchingConfig) -> _Candidates:
    pose, means = joint.mean[:3], joint.mean[3:].reshape(-1, 2)
    alpha_world = segments.lines[:, 0] + pose[2]
    turned = alpha_world[:, None] - means[:, 0]
    segment, line = np.nonzero(np.cos(turned) > np.cos(config.angle_rad))
    lines, cov = segments.lines[segment], segments.cov[segment]
    model = innovations(pose, joint.anchors[line], means[line], lines, cov)
    model = halfway(model, lines, cov, model.e[:, 0] * _share_of_heading(line, joint, model))
    d2 = pair_distances(model, line, joint)
    along = _along(segments.ends[segment], joint.anchors[line], means[line, 0], pose)
    near = (np.abs(model.e[:, 1]) < config.offset_m) | (d2 <= gate_level(config.doubt, 2))
    near &= ~_shows_more(along, walls, line, config)
    segment, line = segment[near], line[near]
    return _Candidates(segment, line, model.take(near), d2[near], _gaps(along[near], walls.extents[line]))


def _shows_more(
    along: Float[np.ndarray, "c 2"], walls: KnownWalls, line: Int[np.ndarray, " c"], config: MatchingConfig
) -> Bool[np.ndarray, " c"]:
    """Return which segments reach past a short wall of which both ends were seen."""
    if walls.whole is None:
        return np.zeros(len(line), dtype=bool)
    low, high = walls.extents[line].T
    past = np.maximum(along[:, 1] - high, low - along[:, 0])
    return walls.whole[line] & (high - low < config.short_m) & (past > config.whole_m)


def _share_of_heading(line: Int[np.ndarray, " c"], joint: Joint, model: Innovations) -> Float[np.ndarray, " c"]:
    """Return how much of the turn between a segment and its line the robot's heading and the line's own explain."""
    at = 3 + 2 * line
    variance = joint.cov[2, 2] - 2.0 * joint.cov[2, at] + joint.cov[at, at]
    return np.asarray(variance / (variance + model.R[:, 0, 0]))


def _along(
    ends_robot: Float[np.ndarray, "c 2 2"],
    anchors: Float[np.ndarray, "c 2"],
    alpha: Float[np.ndarray, " c"],
    pose_world: Float[np.ndarray, "3"],
) -> Float[np.ndarray, "c 2"]:
    """Return from and to of each segment along its line, m from the line's anchor."""
    offsets = to_world(ends_robot, pose_world) - anchors[:, None]
    return np.vecdot(offsets, directions(alpha)[:, None])


def _gaps(along: Float[np.ndarray, "c 2"], extents: Float[np.ndarray, "c 2"]) -> Float[np.ndarray, " c"]:
    """Return the distance along the line from each segment to its wall, m; negative where they overlap by that much."""
    return np.maximum(along[:, 0] - extents[:, 1], extents[:, 0] - along[:, 1])


def _is_beside(found: _Candidates, segments: Segments, config: MatchingConfig) -> np.ndarray:
    """Which candidates are short segments lying along a wall, however badly their direction is known."""
    length = segments.lengths_m[found.segment]
    turn = config.beside_rad + 3.0 * np.sqrt(segments.cov[found.segment, 0, 0])
    return (
        (length < config.short_m)
        & (np.abs(found.model.e[:, 0]) < turn)
        & (np.abs(found.model.e[:, 1]) < config.beside_m)
        & (found.gap <= -OVERLAP_SHARE * length * np.cos(found.model.e[:, 0]))
    )


def pair_distances(model: Innovations, line: Int[np.ndarray, " c"], joint: Joint) -> Float[np.ndarray, " c"]:
    """Return the squared Mahalanobis distance of each pair, from the joint covariance of pose and line."""
    columns = 3 + 2 * line[:, None] + np.arange(2)
    pose_line = joint.cov[:3][:, columns].transpose(1, 0, 2)
    line_line = joint.cov[columns[:, :, None], columns[:, None, :]]
    cross = model.H_pose @ pose_line @ model.H_line.swapaxes(1, 2)
    S = model.H_pose @ joint.cov[:3, :3] @ model.H_pose.swapaxes(1, 2) + cross + cross.swapaxes(1, 2)
    S += model.H_line @ line_line @ model.H_line.swapaxes(1, 2) + model.R
    return squared_distances(model.e, S)


def _agreed(
    found: _Candidates, rows: Int[np.ndarray, " r"], segments: Segments, joint: Joint, config: MatchingConfig
) -> Int[np.ndarray, " k"]:
    """Return the candidates among `rows` that agree on where the robot is, where no other choice is nearly as good."""
    seen = taken_together(joint, found.line[rows], found.model.take(rows))
    sure = ~segments.is_tentative[found.segment[rows]]
    agreed = agree(found.segment[rows], found.line[rows], seen, sure, config.gate, config.doubt, config.density)
    clear = agreed.pairs[agreed.margin >= config.clear]
    return rows[clear[compatible(seen.take(clear), config.gate, config.doubt)]]


def _nearest(
    found: _Candidates, rows: Int[np.ndarray, " r"], joint: Joint, config: MatchingConfig
) -> Int[np.ndarray, " k"]:
    """Return for each segment its nearest candidate among `rows`, unless another is nearly as near."""
    model = found.model.take(rows)
    seen = taken_together(joint, found.line[rows], model)
    segment, d2 = found.segment[rows], found.d2[rows]
    return rows[nearest_alone(segment, d2, seen, model.R, config.one_wall, config.clear)]


def _still_overlapping(
    chosen: Int[np.ndarray, " m"],
    found: _Candidates,
    segments: Segments,
    walls: KnownWalls,
    joint: Joint,
    config: MatchingConfig,
) -> Int[np.ndarray, " k"]:
    """Drop pairs that no longer overlap at the pose that all of them lead to.

    A slip of the wheels by 2 degrees shifts a piece of wall 3 m away by 0.1 m along its line, past the end of the wall
    between two rooms and onto the next room's.
    """
    seen = taken_together(joint, found.line[chosen], found.model.take(chosen))
    pose = joint.mean[:3] + seen.gain()[:3] @ seen.e
    line = found.line[chosen]
    alpha = joint.mean[3 + 2 * line]
    along = _along(segments.ends[found.segment[chosen]], joint.anchors[line], alpha, pose)
    return chosen[_gaps(along, walls.extents[line]) <= -config.overlap_m]


def _refusals(
    found: _Candidates, ids: Int[np.ndarray, " n"], unmatched: np.ndarray, level: float, config: MatchingConfig
) -> dict[int, str]:
    reasons: dict[int, str] = {}
    order = np.argsort(-found.d2, kind="stable")
    for pair in order[unmatched[found.segment[order]]]:
        wall, d2, gap = ids[found.line[pair]], found.d2[pair], found.gap[pair]
        if gap > -config.overlap_m:
            why = f"{max(gap, 0.0):.2f} m beyond the end of wall {wall}"
        elif d2 > level:
            why = f"squared distance {d2:.1f} from wall {wall} (gate {level:.1f})"
        else:
            why = f"wall {wall} is not the only one that fits"
        reasons[int(found.segment[pair])] = why
    return reasons
