"""Odometry from scans: each is laid onto the last ones, about where the wheels say that it was taken."""

from collections import deque

import numpy as np
from jaxtyping import Float

from ..geometry.poses import compose, inverse, rotation, to_world
from ..robot import Odometry, Scan
from .config import ScanMatchingConfig
from .field_kernels import LikelihoodField, field_of
from .point_kernels import joined, surface_normals, thinned
from .point_to_line import Prior, Surfaces, settle
from .search_kernels import Window, correlate, refine
from .surface_kernels import NEAREST, NOTHING_SIGMAS, sorted_into_buckets

DEFAULTS = ScanMatchingConfig()
NOTHING_SCORE = 0.25
"""A scan whose points score less wherever they lie has nothing in common with those before it: the wheels say."""


def returns_within(scan: Scan, reach_m: float) -> Float[np.ndarray, "n 2"]:
    """Return the returns of a scan that are nearer than this, robot frame, in the order of their beams."""
    near = np.flatnonzero(scan.ranges_m < reach_m)
    ranges, bearings = scan.ranges_m[near], scan.bearings_rad[near]
    return ranges[:, None] * np.stack([np.cos(bearings), np.sin(bearings)], axis=-1)


def told_by_scans(
    before: Scan, after: Scan, guess: Float[np.ndarray, "3"], half_m: float, half_rad: float
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Return the scanner's motion between two scans, in its frame before it, and the information that they give of it.

    It is sought about a guess, so far to each side. The guess decides between places that are alike, and counts for
    nothing else; the information is zero where the scans have nothing in common.
    """
    c, nothing = DEFAULTS, (guess, np.zeros((3, 3)))
    returns = returns_within(after, c.reach_m)
    points = thinned(returns, c.cell_m)
    surface = thinned(joined(returns_within(before, c.reach_m), c.cell_m, c.gap_m), 0.5 * c.cell_m)
    if len(points) < c.least_points or not len(surface):
        return nothing
    farthest = float(np.hypot(*points.T).max())
    field = field_of(surface, guess[:2], farthest + half_m, c.cell_m, c.kernel_m, int(np.ceil(half_m / c.cell_m)) + 2)
    worth = c.independent * len(points) * (c.kernel_m / c.sigma_m) ** 2
    mild = np.diag([half_m**-2, half_m**-2, half_rad**-2]) / worth
    coarse, _ = correlate(field, points, Window(guess, half_m, half_rad, c.step_rad, mild))
    pose, score = refine(field, points, coarse, c.step_rad, c.finest_m)
    if score < c.slip_score:
        return nothing
    # Across a corridor, the last returns of both walls are neighbours: no surface runs from one to the other.
    normals, known = surface_normals(returns, c.gap_m)
    earlier = sorted_into_buckets(surface, guess, farthest + half_m + NEAREST * NOTHING_SIGMAS * c.kernel_m)
    surfaces = Surfaces(returns[known], normals[known])
    weak = Prior(pose, np.diag([1e-2, 1e-2, 1e-2]))
    pose, information = settle(earlier, surfaces, pose, weak, c.sigma_m, c.kernel_m)
    floor = np.diag([c.floor_m**2, c.floor_m**2, c.floor_rad**2])
    told = np.linalg.inv(np.linalg.inv(c.independent * information + weak.information) + floor)
    return pose, told


class ScanMatcher:
    """Keeps the points of the last scans in a frame of its own, and the pose of the last one there."""

    def __init__(self, config: ScanMatchingConfig = DEFAULTS) -> None:
        self._config = config
        self._pose = np.zeros(3)
        self._points: deque[np.ndarray] = deque(maxlen=config.keyframes)
        self.slips = 0
        """How often the search went wide and found the scan again."""

    def begin(self, scan: Scan) -> None:
        """Take in the first scan, to which no motion led."""
        self._keep(returns_within(scan, self._config.reach_m))

    def match(self, scan: Scan, wheels: Odometry, keep: bool = True) -> Odometry:
        """Return the motion that led to a scan, with its covariance; from the last scan that was kept.

        Wheels and scan are fused by their covariances, so that along a bare corridor, where scans tell nothing, the
        wheels have their say. What is stated is less sure than that: only a share of the points counts, since their
        errors are common to neighbours, and since the same scan goes on to tell the map its lines.
        """
        c = self._config
        returns = returns_within(scan, self._config.reach_m)
        points = thinned(returns, self._config.cell_m)
        guess = compose(self._pose, wheels.motion)
        odometry = wheels
        if self._points and len(points) >= c.least_points:
            odometry = self._matched(points, guess, wheels)
        if keep:
            self._pose = compose(self._pose, odometry.motion)
            self._keep(returns)
        return odometry

    def _keep(self, returns: Float[np.ndarray, "n 2"]) -> None:
        c = self._config
        surface = thinned(joined(returns, c.cell_m, c.gap_m), 0.5 * c.cell_m)
        self._points.append(to_world(surface, self._pose))

    def _matched(self, points: Float[np.ndarray, "n 2"], guess: Float[np.ndarray, "3"], wheels: Odometry) -> Odometry:
        c = self._config
        before = thinned(np.concatenate(self._points), 0.5 * c.cell_m)
        wheels_cov = wheels.cov + np.diag([1e-8, 1e-8, 1e-10])
        R = np.eye(3)
        R[:2, :2] = rotation(self._pose[2])
        half_m = max(c.gate_sigmas * float(np.sqrt(np.trace(wheels_cov[:2, :2]) / 2)), c.cell_m)
        half_rad = max(c.gate_sigmas * float(np.sqrt(wheels_cov[2, 2])), c.step_rad)
        farthest = float(np.hypot(*points.T).max())
        field = self._field(before, guess, farthest + half_m, half_m)
        # So much log-likelihood is one unit of the score: both fall alike about the best place.
        worth = c.independent * len(points) * (c.kernel_m / c.sigma_m) ** 2
        P = R @ np.linalg.inv(wheels_cov) @ R.T / worth
        pose, score = self._best(field, points, Window(guess, half_m, half_rad, c.step_rad, P))
        if score < c.slip_score:
            slipped = wheels_cov + np.diag([half_m**2, half_m**2, c.slip_rad**2])
            P = R @ np.linalg.inv(slipped) @ R.T / worth
            found, better = self._best(field, points, Window(guess, half_m, c.slip_rad, c.step_rad, P))
            if better >= c.slip_score:
                pose, score = found, better
                wheels_cov = slipped
                self.slips += 1
        if score < NOTHING_SCORE:
            return wheels
        prior = np.linalg.inv(wheels_cov)
        normals, known = surface_normals(points, c.surface_m)
        earlier = sorted_into_buckets(before, guess, farthest + half_m + NEAREST * NOTHING_SIGMAS * c.kernel_m)
        pose, information = settle(
            earlier, Surfaces(points[known], normals[known]), pose, Prior(guess, R @ prior @ R.T), c.sigma_m, c.kernel_m
        )
        cov = np.linalg.inv(prior + c.independent * R.T @ information @ R)
        floor = np.diag([c.floor_m**2, c.floor_m**2, c.floor_rad**2])
        motion = compose(inverse(self._pose), pose)
        return Odometry(motion, 0.5 * (cov + cov.T) + floor, wheels.touched, by_scans=score >= c.slip_score)

    def _field(
        self,
        before: Float[np.ndarray, "m 2"],
        guess: Float[np.ndarray, "3"],
        reach_m: float,
        half_m: float,
    ) -> LikelihoodField:
        c = self._config
        margin = int(np.ceil(half_m / c.cell_m)) + 2
        return field_of(before, guess[:2], reach_m, c.cell_m, c.kernel_m, margin)

    def _best(
        self, field: LikelihoodField, points: Float[np.ndarray, "n 2"], window: Window
    ) -> tuple[Float[np.ndarray, "3"], float]:
        coarse, _ = correlate(field, points, window)
        return refine(field, points, coarse, self._config.step_rad, self._config.finest_m)
