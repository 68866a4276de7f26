"""Simulated drives for second looks: buildings, ways through them, what is seen on the way, and motions that drift."""

from itertools import pairwise

import numpy as np
import shapely

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.association.second_looks.closures import Drive
from chainslam.slam.geometry.poses import compose, inverse

NICHES = [(2, -0.8, 3, 0), (7, -0.5, 8.5, 0), (11.9, 3, 13, 4), (4, 8, 5.5, 8.6), (9, 8, 10, 9), (-0.7, 5, 0, 6)]
RING = shapely.box(0, 0, 12, 8).difference(shapely.box(2, 2, 10, 6)).union(
    shapely.union_all([shapely.box(*niche) for niche in NICHES])
)  # fmt: skip
"""A corridor around a block, 2 m wide, with niches of which no two are alike."""


def faces_of(polygon):
    polygon = shapely.orient_polygons(polygon)
    rings = [polygon.exterior, *polygon.interiors]
    corners = [shapely.get_coordinates(ring) for ring in rings]
    return np.concatenate([np.stack([each[:-1], each[1:]], axis=1) for each in corners])


def along(way, step_m, length_m):
    """Poses along a closed way, each headed for where the way is 0.3 m farther on."""
    at_m = np.arange(0.0, length_m, step_m)
    at = shapely.get_coordinates([way.interpolate(s % way.length) for s in at_m])
    ahead = shapely.get_coordinates([way.interpolate((s + 0.3) % way.length) for s in at_m])
    return np.column_stack([at, np.arctan2(*(ahead - at).T[::-1])])


def round_the_ring(step_m=0.4, laps=1.4):
    """Poses along the middle of the corridor."""
    way = shapely.LinearRing([(1, 1), (11, 1), (11, 7), (1, 7)])
    return along(way, step_m, laps * way.length)


def returns_at(poses, seed=0, reach_m=3.9, building=RING):
    """What a scanner of 4 m returns from each pose, robot frame, without what is farther than `reach_m`."""
    finder = RangeFinder(faces_of(building), LidarConfig())
    rng = np.random.default_rng(seed)
    found = []
    for pose in poses:
        ranges = finder.cast(pose)[0] + 0.01 * rng.standard_normal(len(finder.bearings_rad))
        near = ranges < reach_m
        bearings = finder.bearings_rad[near]
        found.append(ranges[near, None] * np.column_stack([np.cos(bearings), np.sin(bearings)]))
    return found


def motions_of(poses):
    return np.array([compose(inverse(a), b) for a, b in pairwise(poses)])


def drifting(true, turn_a_step=0.004, seed=3):
    rng = np.random.default_rng(seed)
    motions = motions_of(true)
    return motions + rng.normal(0.0, [0.005, 0.005, 0.002], motions.shape) + [0.0, 0.0, turn_a_step]


STATED = np.array([0.03, 0.03, 0.008])
"""What matching typically states of a motion: sigmas, m m rad."""


def driven(motions, slipped=()):
    """Motions with what matching typically states of them."""
    return Drive(motions, np.tile(np.diag(STATED) ** 2, (len(motions), 1, 1)), slipped)


def followed(start, motions):
    poses = [start]
    for motion in motions:
        poses.append(compose(poses[-1], motion))
    return np.array(poses)


def off_m(poses, true):
    return np.hypot(*(poses - true)[:, :2].T)
