"""Walls that bend or step, noisy scans of them, drives past them, and beams that cross lines."""

import numpy as np

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.backends import BACKENDS
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Scan

SIGMA_M, WALL = 0.01, 7
AROUND = np.array([[[3.0, -4.0], [3.0, 2.0]], [[3.0, 2.0], [-3.0, 2.0]], [[-3.0, 2.0], [-3.0, -4.0]]])
"""Long walls about the robot, by which it knows where it stands."""


def bent(turn_rad, at_m=0.0, half_m=6.0):
    """Return the faces of a wall along y = 0, free side below, which turns at `at_m`."""
    bend, end = np.array([at_m, 0.0]), half_m - at_m
    return np.array([[[half_m, -end * np.tan(turn_rad)], bend], [bend, [-half_m, 0.0]]])


def stepped(step_m, half_m=0.4):
    """Return two faces along y = 0, free side below, the left one farther back; and what is between and beside them."""
    way = [[half_m, 1.0], [half_m, 0.0], [0.0, 0.0], [0.0, step_m], [-half_m, step_m], [-half_m, 1.0]]
    return np.array([[way[k], way[k + 1]] for k in range(len(way) - 1) if way[k] != way[k + 1]])


def scans(faces, poses, rng, sigma_m=SIGMA_M, range_max_m=4.0):
    """Yield noisy scans from poses; the noise stated is 10 mm."""
    finder = RangeFinder(faces, LidarConfig())
    for k, pose in enumerate(poses):
        ranges = finder.cast(pose)[0]
        noise = sigma_m * rng.standard_normal(len(ranges)) if sigma_m else 0.0
        yield Scan(finder.bearings_rad, ranges + noise, SIGMA_M, range_max_m, 0.1 * k)


def drive(poses, seen, backend, config, sigmas):
    """Go from pose to pose with exact wheels, stated to `sigmas` (m, m, rad); return the update of each scan."""
    mapper = Mapper(BACKENDS[backend].make(poses[0].copy(), 1e-6 * np.eye(3)), config)
    updates = []
    for k, scan in enumerate(seen):
        if k:
            mapper.predict(Odometry(compose(inverse(poses[k - 1]), poses[k]), np.diag(sigmas) ** 2))
        updates.append(mapper.step(scan))
    return updates


def crossing(bearing_rad, passed_m, pose, anchor, alpha, d=0.0):
    """Return where one beam crosses a line, m from its anchor, and how far it goes on across it; NaN where it does not.

    A line is crossed from its free side, and by no beam within 3 degrees of it.
    """
    n, t = np.array([np.cos(alpha), np.sin(alpha)]), np.array([-np.sin(alpha), np.cos(alpha)])
    beam = np.array([np.cos(bearing_rad + pose[2]), np.sin(bearing_rad + pose[2])])
    before = d - n @ (pose[:2] - anchor)
    if before <= 0.0 or beam @ n <= 0.05:
        return np.nan, np.nan
    return t @ (pose[:2] + before / (beam @ n) * beam - anchor), n @ (passed_m * beam) - before
