"""A scale of ranges, told from how far scans say the robot went and how far its wheels say.

An estimate in which walls hold the pose lives in the scanner's metres. Over a way u by the wheels, turned by the
headings of the estimate, its pose moves by (1 + e) u for a scale 1 + e. What the wheels slipped on that way has the
variance c along it; the pose's own variance grows by G, from 0 where walls hold it to c where none does. The share
g = 1 - G / c of a difference is what the scans saw of it, so the way tells e with the information g u^2 / c.
"""

import numpy as np
from jaxtyping import Float

from ...geometry.poses import rotation
from ...robot import Odometry
from .errors import DEFAULTS, RangesConfig


class RangeScale:
    """The scale as far as the ways driven tell it. The estimate may hold another scale already (`metre`)."""

    def __init__(self, config: RangesConfig = DEFAULTS) -> None:
        self._window_m = config.window_m
        self._information, self._score = config.scale**-2, 0.0
        self._before: tuple[Float[np.ndarray, 3], Float[np.ndarray, "3 3"]] | None = None
        self._way, self._cov, self._length_m = np.zeros(2), np.zeros((2, 2)), 0.0

    @property
    def mean(self) -> float:
        """The likeliest scale."""
        return 1.0 + self._score / self._information

    @property
    def sigma(self) -> float:
        """Its standard deviation."""
        return float(self._information**-0.5)

    def move(self, odometry: Odometry, heading_rad: float) -> None:
        """Take note of what the wheels report of a motion from a heading on; scans that tell it know of none."""
        if odometry.by_scans:
            self._before = None
            return
        R = rotation(heading_rad)
        self._way = self._way + R @ odometry.motion[:2]
        self._cov = self._cov + R @ odometry.cov[:2, :2] @ R.T
        self._length_m += float(np.hypot(*odometry.motion[:2]))

    def see(self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"], metre: float = 1.0) -> None:
        """Take note of where a scan puts the robot, in metres of the scanner.

        `metre` is the scale by which the estimate takes the wheels' motions.
        """
        if self._before is None:
            self._begin(pose_world, pose_cov)
        if self._before is None or self._length_m < self._window_m:
            return
        length_m = float(np.hypot(*self._way))
        pose, cov = self._before
        ahead = self._way / max(length_m, 1e-9)
        slip = float(ahead @ self._cov @ ahead)
        grown = float(ahead @ (pose_cov - cov)[:2, :2] @ ahead)
        share = 1.0 - min(max(grown, 0.0) / slip, 1.0)
        # An estimate that grew surer, as where a loop closes, has moved by as much as it had been unsure.
        information = length_m**2 / (slip + max(-grown, 0.0))
        off = float(ahead @ (pose_world[:2] - pose[:2])) / max(length_m, 1e-9) - metre
        self._information += information * share
        self._score += information * (off + share * (metre - 1.0))
        self._begin(pose_world, pose_cov)

    def _begin(self, pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"]) -> None:
        self._before = pose_world.copy(), pose_cov.copy()
        self._way, self._cov, self._length_m = np.zeros(2), np.zeros((2, 2)), 0.0
