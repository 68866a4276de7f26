"""One scan beside the walls that it can show: matched, used to localise, and matched again (paper, section 2.2)."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ..estimation.backend import Joint, Observations
from ..estimation.gates import gate_level
from ..extraction.segments import Segments
from ..geometry.lines import segment_distances
from ..geometry.poses import to_world
from ..robot import Odometry
from .joint_compatibility import Nis
from .matching import KnownWalls, Matches, MatchingConfig
from .methods import Method
from .motion_noise import MotionInnovation, motion_root, surprise


@dataclass(frozen=True)
class View:
    """All that matching is told of one scan."""

    segments: Segments
    walls: KnownWalls
    joint: Joint
    """Of the pose and these walls, before the scan."""
    method: Method
    config: MatchingConfig

    def match_clear(self) -> Matches:
        """Return the matches that are beyond doubt."""
        return self.method.matcher(self.segments, self.walls, self.joint, self.config, clear_only=True)

    def match_all(self) -> Matches:
        """Return all matches, from the pose before the scan."""
        return self.method.matcher(self.segments, self.walls, self.joint, self.config)

    def localised(self, first: Observations) -> Joint:
        """Return pose and walls as they are known once some walls were observed."""
        return self.method.relocate(self.joint, self.walls.ids, first)

    def surprise(self, first: Observations, odometry: Odometry) -> tuple[Nis, MotionInnovation | None]:
        """Return how far observations lie from where the belief puts them after `odometry`, and what they say of it."""
        return surprise(self.joint, self.walls.ids, first, motion_root(odometry, float(self.joint.mean[2])))

    def match_again(self, clear: Matches, relocated: Joint) -> Matches:
        """Return the matches from the new pose: of the remaining segments, beside the clear ones, or of all."""
        if not self.method.clear_stay:
            return self.method.matcher(self.segments, self.walls, relocated, self.config)
        rest = clear.unmatched
        again = self.method.matcher(self.segments.take(rest), self.walls, relocated, self.config)
        more = again.pairs.copy()
        more[:, 0] = rest[more[:, 0]]
        return Matches(
            np.concatenate([clear.pairs, more]),
            np.concatenate([clear.distances, again.distances]),
            rest[again.unmatched],
            rest[again.doubtful],
            {int(rest[k]): why for k, why in again.refusals.items()},
            again.ambiguous,
        )


def may_be_off_m(
    pose_cov: Float[np.ndarray, "3 3"], config: MatchingConfig, away_m: Float[np.ndarray, " n"]
) -> Float[np.ndarray, " n"]:
    """Return how far what is seen so far away may lie from where it is believed, m.

    By what the pose may be off up to the level of doubt, and far enough for walls that are known less well.
    """
    sigmas_m = np.sqrt(np.trace(pose_cov[:2, :2])) + away_m * np.sqrt(pose_cov[2, 2])
    return config.shared.far_m + np.sqrt(gate_level(config.doubt, 2)) * sigmas_m


def near_segments(
    segments: Segments,
    ends_world: Float[np.ndarray, "n 2 2"],
    pose_world: Float[np.ndarray, "3"],
    pose_cov: Float[np.ndarray, "3 3"],
    config: MatchingConfig,
) -> Bool[np.ndarray, " n"]:
    """Return which walls, by their ends, lie so near a segment that it may be of them.

    Of the others no more is asked: a joint covariance with hundreds of walls takes longer than all matching with it.
    """
    if not len(segments) or not len(ends_world):
        return np.zeros(len(ends_world), dtype=bool)
    away_m = np.hypot(segments.ends[..., 0], segments.ends[..., 1]).max(axis=1)
    apart = segment_distances(to_world(segments.ends, pose_world), ends_world)
    return np.asarray(np.any(apart < may_be_off_m(pose_cov, config, away_m)[:, None], axis=0))
