"""One scan beside the walls that it can show: matched, used to localise, and matched again (paper, section 2.2)."""

import math
from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float

from ..estimation.backend import Joint, Observations
from ..estimation.gates import gate_level
from ..extraction.segments import Segments
from ..geometry.compiled import plain
from ..robot import Odometry
from .joint_compatibility import JointObservations, Nis, seen_halfway
from .kernels import near_kernels
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

    def seen(self, first: Observations) -> JointObservations:
        """Return observations of some of the walls beside what was believed of them before."""
        return seen_halfway(self.joint, self.walls.ids, first)

    def localised(self, seen: JointObservations) -> Joint:
        """Return pose and walls as they are known once some walls were observed."""
        return self.method.relocate(self.joint, seen)

    def surprise(self, seen: JointObservations, odometry: Odometry) -> tuple[Nis, MotionInnovation | None]:
        """Return how far observations lie from where the belief puts them after `odometry`, and what they say of it."""
        return surprise(seen, motion_root(odometry, float(self.joint.mean[2])))

    def match_again(self, clear: Matches, seen: JointObservations) -> Matches:
        """Return the matches from the new pose: of the remaining segments, beside the clear ones, or of all."""
        if not self.method.clear_stay:
            return self.method.matcher(self.segments, self.walls, self.localised(seen), self.config)
        rest = clear.unmatched
        if not len(rest):
            return clear
        again = self.method.matcher(self.segments.take(rest), self.walls, self.localised(seen), self.config)
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


def may_be_off(pose_cov: Float[np.ndarray, "3 3"], config: MatchingConfig) -> tuple[float, float]:
    """Return how far what is seen may lie from where it is believed, m, and by how much it may be turned, rad.

    By what the pose may be off up to the level of doubt, and far enough for walls that are known less well.
    """
    sigmas = math.sqrt(gate_level(config.doubt, 2))
    off_m = config.shared.far_m + sigmas * math.sqrt(pose_cov[0, 0] + pose_cov[1, 1])
    return off_m, sigmas * math.sqrt(pose_cov[2, 2])


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
    return near_kernels.near_segments(segments.ends, ends_world, plain(pose_world), *may_be_off(pose_cov, config))
