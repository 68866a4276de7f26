"""Places that the robot came back to, and the poses that agree best with them and with the motions between scans."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from .config import ClosuresConfig, SecondLooksConfig
from .landmarks import NO_SIGHTINGS
from .solve import Links, of_links, solved, whiteners, without_lines

LEAST_COV = np.diag([1e-8, 1e-8, 1e-10])
"""Wheels may state that they never go sideways."""


@dataclass(frozen=True)
class Closure:
    """Where a scan was taken, as seen from an old one."""

    old: int
    new: int
    motion: Float[np.ndarray, "3"]


@dataclass(frozen=True)
class Drive:
    """The motions from each scan to the next, robot frame, and the scans before which the robot slipped."""

    motions: Float[np.ndarray, "t 3"]
    covs: Float[np.ndarray, "t 3 3"]
    """Of each motion, as it is stated."""
    slipped: Sequence[int] = ()
    carried: Sequence[int] = ()
    """Scans to which the robot was carried: the first ones of later sessions."""

    def believed(self, config: SecondLooksConfig) -> Float[np.ndarray, "t 3 3"]:
        """Return the covariance of each motion as it counts: scan matching states more than its error."""
        covs = self.covs / config.understated
        rows = np.array(self.carried, dtype=np.int64) - 1
        covs[rows] = self.covs[rows]
        return covs

    def links(self, doubt: float, config: SecondLooksConfig) -> Links:
        """Return the motions as links that count less from so many standard deviations on; slips hold little."""
        slip = np.diag(np.square([*[config.closures.slip_m] * 2, config.closures.slip_rad]))
        covs = self.believed(config) + LEAST_COV
        covs[np.array(self.slipped, dtype=np.int64) - 1] = slip
        at = np.arange(len(self.motions))
        return Links(at, at + 1, self.motions, whiteners(covs), doubt)


def closure_links(closures: Sequence[Closure], doubt: float, config: ClosuresConfig) -> Links:
    """Return closures as links that count less from so many standard deviations on."""
    return Links(
        np.array([each.old for each in closures], dtype=np.int64),
        np.array([each.new for each in closures], dtype=np.int64),
        np.array([each.motion for each in closures]).reshape(-1, 3),
        np.tile(np.diag(1.0 / np.array([config.sigma_m, config.sigma_m, config.sigma_rad])), (len(closures), 1, 1)),
        doubt,
    )


def settled(
    poses: Float[np.ndarray, "s 3"], drive: Drive, closures: Sequence[Closure], config: SecondLooksConfig
) -> Float[np.ndarray, "s 3"]:
    """Return the poses that agree best with motions and closures; a closure that the others contradict gives way."""
    found = without_lines(poses)
    for doubt in config.closures.doubts:
        links = (drive.links(doubt, config), closure_links(closures, doubt, config.closures))
        found = solved(found, links, NO_SIGHTINGS, np.zeros(0, dtype=np.int64), config)
    return found.poses


def held(closures: Sequence[Closure], poses: Float[np.ndarray, "s 3"], config: ClosuresConfig) -> list[Closure]:
    """Return the closures with which the poses agree; the others are taken back."""
    errors = of_links(poses, closure_links(closures, 1.0, config)).errors
    return [each for each, error in zip(closures, errors, strict=True) if np.linalg.norm(error) < config.taken_back]
