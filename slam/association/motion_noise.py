"""Whether the wheels slip more than they state, and how much, told from where scans put the robot after each motion.

With S the covariance of a scan's innovations e under the stated noise, and G the root of the noise that the last motion
added to the pose, noise f times as large makes it S + (f² - 1) H G G' H'. Along the axes of A = G' H' S^-1 H G the
likelihood of f falls into three terms: with w = G' H' S^-1 e, of variance a (1 + (f² - 1) a) on an axis of eigenvalue
a. So a scan leaves three pairs (a, w), and a window of them tells the likeliest f, and how sure it is that f is not 1.
"""

from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from ..estimation.shared import SharedConfig, of_shared
from ..geometry.compiled import plain
from ..geometry.quantities import Count
from ..robot import Odometry
from .joint_compatibility import NO_NIS, JointObservations, Nis
from .kernels import motion_kernels


@dataclass(frozen=True)
class MotionNoiseConfig:
    """When the wheels are taken to be noisier than stated."""

    shared: SharedConfig = of_shared()
    window: Count = 50
    """Number of scans whose innovations are tested together."""


FACTORS = np.array([0.5, 0.7, 1.5, 2.0, 3.0, 4.0, 6.0])
"""How many times the standard deviation that is believed now is tried."""


@dataclass(frozen=True)
class MotionInnovation:
    """What one scan says of the noise of the last motion, along three independent axes."""

    a: Float[np.ndarray, "3"]
    """How well the scan tells the motion's noise, from 0 to 1: the share of the innovation's variance that it makes."""
    w: Float[np.ndarray, "3"]
    """Of mean zero and variance a if the noise is as stated."""


def surprise(seen: JointObservations, motion_root: Float[np.ndarray, "3 3"]) -> tuple[Nis, MotionInnovation | None]:
    """Return the NIS of observations of some lines of the joint Gaussian, and what they say of the last motion.

    `motion_root` is G, world frame, with G G' the covariance that the motion added to the pose.
    """
    if not len(seen.e):
        return NO_NIS, None
    squared, a, w = motion_kernels.surprise(seen.e, seen.H_pose, seen.W, motion_root)
    return Nis(squared, len(seen.e)), MotionInnovation(a, w)


def motion_root(odometry: Odometry, heading_rad: float) -> Float[np.ndarray, "3 3"]:
    """Return G of a motion, world frame, that ended in a heading; its covariance may be singular."""
    return motion_kernels.motion_root(plain(odometry.cov), float(heading_rad - odometry.motion[2]))


class MotionNoise:
    """How many times as large as stated the noise of the wheels is taken to be; 1 until scans show otherwise."""

    def __init__(self, config: MotionNoiseConfig = MotionNoiseConfig()) -> None:
        self.factor = 1.0
        self._config = config
        self._forget()

    def _forget(self) -> None:
        """Begin the window anew."""
        self._gains, self._scans = np.zeros((self._config.window, len(FACTORS))), 0

    def believed(self, odometry: Odometry) -> Odometry:
        """Return odometry with the noise that it is taken to have."""
        return odometry if self.factor == 1.0 else replace(odometry, cov=self.factor**2 * odometry.cov)

    def see(self, innovation: MotionInnovation) -> None:
        """Weigh one scan more; changes `factor` where all in the window leave no doubt."""
        self._gains[self._scans % self._config.window] = gains_of(innovation)
        self._scans += 1
        gains = self._gains.sum(axis=0)
        best = int(np.argmax(gains))
        if gains[best] > -np.log(self._config.shared.chance):
            factor = max(1.0, self.factor * float(FACTORS[best]))
            if factor != self.factor:
                self.factor = factor
                self._forget()


def gains_of(innovation: MotionInnovation) -> Float[np.ndarray, " f"]:
    """Return by how much each of `FACTORS` raises the log-likelihood of one scan over that of the believed noise."""
    return motion_kernels.gains(innovation.a, innovation.w, FACTORS)
