"""A motion that the wheels did not report, told from what it would explain: a bump, a slip, a robot that was lifted.

After it no wall is where the belief puts it: each segment of the scan would become a new wall, and from then on all of
them agree with a pose that is wrong. So before a scan is taken in, the belief is asked whether it explains more of the
scan once the robot may have moved by more than it said. A motion that did not happen explains nothing more: where
the robot stands where it believes, a wall that nobody has seen fits no known one together with those around it. If no
such motion explains the scan and beams go through known walls, the robot is lost; the whole map is searched then. A
place elsewhere has to be earned (`leap`).
"""

from collections.abc import Callable
from dataclasses import dataclass, field, replace

import numpy as np
from jaxtyping import Bool, Float

from ..estimation.backend import Joint
from ..estimation.shared import SharedConfig, of_shared
from ..extraction.segments import Segments
from ..geometry.poses import compose, inverse
from ..geometry.quantities import Deviation, Number, Share, Spread
from ..map.kernels.ray_evidence import ray_evidence
from ..map.stochastic_map import StochasticMap
from ..odometry.diagnosis import DiagnosisConfig
from ..robot import Odometry, Scan
from .joint_compatibility import NO_NIS, Nis
from .leap import Leap
from .matching import Matches
from .motion_noise import MotionNoiseConfig
from .place_search import PlaceSearchConfig, place_of
from .view import View


@dataclass(frozen=True)
class RecoveryConfig:
    """How an unmodelled motion (slip, bump, kidnapping) is detected, and how a lost robot is relocalised."""

    shared: SharedConfig = of_shared()
    shift_m: Deviation = 0.3
    """Standard deviation of the position after an unmodelled motion."""
    turn_rad: Spread = float(np.deg2rad(15.0))
    """Standard deviation of the heading after an unmodelled motion."""
    least_segments: Number = 3
    """Number of segments that an unmodelled motion must explain beyond those explained without it."""
    least_share: Share = 0.5
    """Share of the segments that it must explain; also, the robot is lost if more than this share of its beams passes
    through known walls."""
    least_beams: Number = 20
    """Smallest number of beams towards known walls by which the robot can count as lost."""
    noise: MotionNoiseConfig | None = field(default_factory=MotionNoiseConfig)
    """Without it, the stated noise is always believed."""
    place: PlaceSearchConfig = field(default_factory=lambda: PlaceSearchConfig(least=0.7))
    """Used for global relocalisation: one scan against the whole map."""
    diagnosis: DiagnosisConfig | None = field(default_factory=DiagnosisConfig)
    """Without it, the robot is relocalised without limit and its faults are not identified."""


@dataclass(frozen=True)
class Localisation:
    """How well a scan fits where the robot was believed to be, and what was made of that."""

    nis: Nis = NO_NIS
    """Of the matches that localised the robot, before they did; those beyond their gate were left out."""
    unstated_motion: Odometry | None = None
    """A motion that the odometry did not report, where the scan showed one."""
    is_lost: bool = False
    """The scan fits nowhere: it was not taken in."""
    is_leap_pending: bool = False
    """It fits elsewhere, and a scan from another place has to say the same."""
    noise_factor: float = 1.0
    """How many times as large as stated the standard deviation of the wheels' noise was taken to be."""
    fault: str = ""
    """What is wrong with the robot, in words, where the map was rescued and the last scans say why."""


def _explains(segments: Segments, matches: Matches, config: RecoveryConfig) -> bool:
    """Return whether matches give a scan's place beyond doubt: most of its sure segments, and enough of them."""
    sure = ~segments.is_tentative
    count = _explained(sure, matches)
    return bool(count >= max(config.least_segments, config.least_share * np.count_nonzero(sure)))


def _leaves_much(segments: Segments, matches: Matches, config: RecoveryConfig) -> bool:
    """Return whether so many sure segments are of no known wall that a motion might explain them."""
    sure = ~segments.is_tentative
    return bool(np.count_nonzero(sure) - _explained(sure, matches) >= config.least_segments)


def unstated_motion(
    scan: Scan,
    view: View,
    matches: Matches,
    walls: StochasticMap,
    was_lost: bool,
    config: RecoveryConfig,
    moved: Callable[[], View],
    leap: Leap,
    may_begin: bool,
) -> tuple[Odometry | None, bool]:
    """Return the motion that explains far more of a scan than `matches` do, as odometry to add, or None; and whether
    the robot is lost, since such a motion must be and none explains the scan.

    Its covariance is as wide as it was sought: where the robot is, the scan tells once it is taken in. `moved` shows
    the scan beside all walls that it may be of after such a motion. A motion that leads farther than that covariance
    is a leap, which begins only where it `may_begin`.
    """
    if not _leaves_much(view.segments, matches, config):
        return None, False
    near = _nearby(moved(), matches, config)
    is_lost = was_lost and not _explains(view.segments, matches, config)
    if near is None and not is_lost and not is_contradicted(scan, walls, config):
        return None, False
    place = place_of(view.segments, walls, config.place, near)
    if place is None:
        return None, True
    motion = compose(inverse(view.joint.mean[:3]), place)
    if np.hypot(*motion[:2]) <= config.shared.outlier_sigmas * config.shift_m:
        return Odometry(motion, unstated_cov(config)), False
    if not leap.is_earned(place, may_begin):
        return None, True
    return Odometry(motion, config.place.cov), False


def _nearby(view: View, matches: Matches, config: RecoveryConfig) -> Float[np.ndarray, "3"] | None:
    """Return the place nearby from which the walls explain far more of a scan than `matches` do, if there is one."""
    wide = replace(view, joint=_widened(view.joint, unstated_cov(config)))
    clear = wide.match_clear()
    seen = wide.seen(clear.observations(view.segments))
    again = wide.match_again(clear, seen)
    sure = ~view.segments.is_tentative
    more = _explained(sure, again) - _explained(sure, matches)
    enough = more >= config.least_segments and _explains(view.segments, again, config)
    return wide.localised(seen).mean[:3] if enough else None


def is_contradicted(scan: Scan, walls: StochasticMap, config: RecoveryConfig) -> bool:
    """Return whether most of the beams towards known walls go through them."""
    belief = walls.belief
    inside_m = config.shared.face_m
    rays = ray_evidence(scan, belief.pose_world, belief.anchors, belief.means)
    inside = rays.between(walls.extents, inside_m)
    through, met = (np.any(beams & inside, axis=0) for beams in (rays.passes(inside_m), rays.hits(inside_m)))
    towards = np.count_nonzero(through | met)
    return bool(towards >= config.least_beams and np.count_nonzero(through) > config.least_share * towards)


def _widened(joint: Joint, motion_cov: Float[np.ndarray, "3 3"]) -> Joint:
    """Return the Gaussian after a motion of mean zero, of a covariance that is the same in all directions."""
    cov = joint.cov.copy()
    cov[:3, :3] += motion_cov
    return replace(joint, cov=cov)


def unstated_cov(config: RecoveryConfig) -> Float[np.ndarray, "3 3"]:
    """Return the covariance of a motion that was not reported, the same in all directions."""
    return np.diag([config.shift_m, config.shift_m, config.turn_rad]) ** 2


def _explained(sure: Bool[np.ndarray, " s"], matches: Matches) -> int:
    """Return how many of the sure segments belong to a known wall, or lie along one."""
    return int(np.count_nonzero(sure[matches.pairs[:, 0]]) + np.count_nonzero(sure[matches.doubtful]))
