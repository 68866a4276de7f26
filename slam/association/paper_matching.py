"""The paper's matching, to the letter (sections 2.1 and 2.2): one gate on each pair, one distance, the nearest wins.

Each segment is judged alone. Its squared Mahalanobis distance in model space from each line must stay below a level of
the chi-square distribution with two degrees of freedom, and the least distance between segment and wall below a
threshold in metres, so that the walls on both sides of a door stay two. The paper names no threshold; here it is less
than a wall is thick, so that the walls on both sides of one that joins them stay two as well. Of the walls that pass it
takes the best. No segment is in doubt: one that nothing passes is a new wall.
"""

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import POSE, Joint
from ..estimation.gates import gate_level
from ..estimation.models import innovations
from ..extraction.segments import Segments
from ..geometry.lines import directions, normals
from ..geometry.poses import to_world
from ..geometry.segment_kernels import segment_distances
from .joint_compatibility import JointObservations, relocate
from .kernels.joint_kernels import pair_distances
from .matching import KnownWalls, Matches, MatchingConfig


def match_alone(
    segments: Segments,
    walls: KnownWalls,
    joint: Joint,
    config: MatchingConfig,
    *,
    clear_only: bool = False,
) -> Matches:
    """Match each segment to the nearest line of `joint` that passes; several segments may be of one wall.

    `clear_only` asks for no less: the paper localises the robot by all that it matches.
    """
    count, lines = len(segments), len(walls.ids)
    segment, line = np.divmod(np.arange(count * lines), max(lines, 1))
    pose, means, anchors = joint.mean[:POSE], joint.mean[POSE:].reshape(-1, 2), joint.anchors
    seen = innovations(pose, anchors[line], means[line], segments.lines[segment], segments.cov[segment])
    cov = np.ascontiguousarray(joint.cov)
    d2 = pair_distances(seen.e, seen.H_pose, seen.H_line, seen.R, line, cov).reshape(count, lines)
    apart = segment_distances(to_world(segments.ends, pose), _ends_world(walls.extents, anchors, means))
    passes = (d2 <= gate_level(config.gate, 2)) & (apart <= config.shared.within_m)
    matched = passes.any(axis=1)
    rows = np.flatnonzero(matched)
    best = _nearest(d2[rows], passes[rows])
    unmatched = np.flatnonzero(~matched)
    return Matches(
        np.stack([rows, walls.ids[best]], axis=-1),
        d2[rows, best],
        unmatched,
        np.zeros(0, dtype=np.int64),
        _refusals(d2, apart, unmatched, walls.ids, config) if lines else {},
    )


def relocate_robot(joint: Joint, seen: JointObservations) -> Joint:
    """Move the robot alone by observations of some of the lines (paper, step 3): the map stays for steps 4 and 5.

    What the robot's error then shares with the lines is that of the optimal gain, whatever the lines do.
    """
    moved = relocate(joint, seen)
    mean, cov = moved.mean.copy(), moved.cov.copy()
    mean[POSE:], cov[POSE:, POSE:] = joint.mean[POSE:], joint.cov[POSE:, POSE:]
    return Joint(mean, cov, joint.anchors)


def _nearest(d2: Float[np.ndarray, "m n"], passes: Bool[np.ndarray, "m n"]) -> Int[np.ndarray, " m"]:
    """Return the line at the least distance of those that pass; of equals the oldest."""
    if not d2.size:
        return np.zeros(len(d2), dtype=np.int64)
    return np.argmin(np.where(passes, d2, np.inf), axis=1)


def _ends_world(
    extents: Float[np.ndarray, "n 2"], anchors: Float[np.ndarray, "n 2"], means: Float[np.ndarray, "n 2"]
) -> Float[np.ndarray, "n 2 2"]:
    """Return where the walls begin and end, m."""
    feet = anchors + means[:, 1:] * normals(means[:, 0])
    return feet[:, None] + extents[..., None] * directions(means[:, 0])[:, None]


def _refusals(
    d2: Float[np.ndarray, "s n"],
    apart: Float[np.ndarray, "s n"],
    unmatched: Int[np.ndarray, " u"],
    ids: Int[np.ndarray, " n"],
    config: MatchingConfig,
) -> dict[int, str]:
    """Return why the likeliest wall of each segment that has none was refused."""
    level, reasons = gate_level(config.gate, 2), {}
    for row in unmatched.tolist():
        near = apart[row] <= config.shared.within_m
        best = int(np.argmin(np.where(near, d2[row], np.inf) if near.any() else d2[row]))
        wall = ids[best]
        reasons[row] = (
            f"squared distance {d2[row, best]:.1f} from wall {wall} (gate {level:.1f})"
            if near.any()
            else f"{apart[row, best]:.2f} m from wall {wall}"
        )
    return reasons
