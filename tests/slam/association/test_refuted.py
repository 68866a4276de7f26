"""What stands in a building for a while only is no wall of it: neither of the map while driving nor of second looks."""

import numpy as np
import pytest
import shapely

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.association.second_looks.config import SecondLooksConfig
from chainslam.slam.association.second_looks.refuted import Rays, refuted
from chainslam.slam.association.second_looks.second_looks import second_looks
from chainslam.slam.association.second_looks.solve import Unknowns
from chainslam.slam.backends import BACKENDS
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.visible_extent import sure_pieces
from chainslam.slam.geometry.lines import directions, normals
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Scan, ScannerSpec
from tests.slam.association.drives import along, driven, faces_of, motions_of

CONFIG = SecondLooksConfig()
ROOM = shapely.box(0, 0, 7, 5).difference(shapely.box(3, 2.2, 4, 2.8))
STATED = np.diag([0.005, 0.005, 0.002]) ** 2
SEEDS = (1, 3, 4, 5)
"""Of six, those in which some cart becomes a wall at all."""


def scan_at(building, pose, rng):
    finder = RangeFinder(faces_of(building), LidarConfig())
    ranges = finder.cast(pose)[0] + 0.01 * rng.standard_normal(len(finder.bearings_rad))
    return Scan(finder.bearings_rad, np.where(ranges < 4.0, ranges, np.inf), 0.01, 4.0, 0.0)


def visited_room(seed):
    """Two laps of a room into which carts come and go: true poses, scans, and the middle of each cart."""
    rng = np.random.default_rng([25, seed])
    way = shapely.LinearRing([(1.5, 1.2), (5.5, 1.2), (5.5, 3.8), (1.5, 3.8)])
    true = along(way, 0.2, 2.0 * way.length)
    carts = []
    for low, high in ([0.35, 0.55], [6.1, 6.3]) * 2:
        x, y, half = rng.uniform(low, high), rng.uniform(1.2, 3.8), rng.uniform([0.25, 0.2], [0.35, 0.45])
        first = int(rng.integers(0, 70))
        carts.append((shapely.box(x - half[0], y - half[1], x + half[0], y + half[1]), first, first + 12))
    scans = []
    for k, pose in enumerate(true):
        there = [cart for cart, first, last in carts if first <= k < last]
        scans.append(scan_at(ROOM.difference(shapely.union_all(there)), pose, rng))
    return true, scans, [cart for cart, _, _ in carts]


def on_carts(walls, carts):
    """Which walls lie on faces of carts."""
    middles = shapely.points(walls.ends_world.mean(axis=1))
    inside = shapely.contains(ROOM.buffer(-0.12), middles)
    near = np.any([shapely.distance(cart.exterior, middles) < 0.12 for cart in carts], axis=0)
    return inside & near & ~walls.tentative


def lengths(walls, carts):
    """How long the walls on carts are, m."""
    return np.diff(walls.extents[on_carts(walls, carts)], axis=1)


def looked_at(true, scans, rays):
    segments = [sure_pieces(extract(scan), scan, ExtractionConfig()) for scan in scans]
    nothing = [np.zeros((0, 2))] * len(true)
    return second_looks(true[0], driven(motions_of(true)), segments, nothing, CONFIG, rays)


@pytest.mark.parametrize("seed", SEEDS)
def test_second_looks_keep_the_walls_and_leave_out_carts_that_were_there_for_a_while(seed):
    true, scans, carts = visited_room(seed)
    kept = looked_at(true, scans, Rays(scans)).walls
    every = looked_at(true, scans, Rays()).walls
    assert on_carts(every, carts).any()
    assert not on_carts(kept, carts).any()
    assert len(every) - len(kept) == np.count_nonzero(on_carts(every, carts))


@pytest.mark.parametrize("seed", SEEDS)
def test_the_map_of_the_drive_cuts_carts_back_to_less_than_its_margins_once_they_are_gone(seed):
    """Beams that pass near the ends of a wall tell it nothing, so that a stump of each face may stay."""
    true, scans, carts = visited_room(seed)
    mapper = Mapper(BACKENDS["full-ekf"].make(true[0], np.diag([1e-4, 1e-4, 1e-5]) ** 2))
    longest = 0.0
    for k, scan in enumerate(scans):
        if k:
            mapper.predict(Odometry(compose(inverse(true[k - 1]), true[k]), STATED))
        walls = mapper.step(scan).map
        longest = max(longest, lengths(walls, carts).max(initial=0.0))
    assert longest > 0.5
    assert lengths(walls, carts).max(initial=0.0) < 0.3


@pytest.mark.parametrize("seed", range(6))
def test_a_line_is_refuted_where_more_scans_see_through_it_than_see_it(seed):
    """Beam by beam, by crossing points of straight lines."""
    rng = np.random.default_rng(seed)
    count, beams, margin = 12, np.linspace(-3.0, 3.0, 90), 0.1
    alpha, anchors = rng.uniform(-np.pi, np.pi, count), rng.uniform(-3.0, 3.0, (count, 2))
    lines, reach = np.column_stack([alpha, np.zeros(count)]), np.sort(rng.uniform(-2.0, 2.0, (count, 2)), axis=1)
    poses, scanner = rng.uniform(-2.0, 2.0, (9, 3)), ScannerSpec(0.2, -0.1, 0.3)
    scans = [Scan(beams, rng.uniform(0.3, 5.0, len(beams)), 0.01, 6.0, 0.0) for _ in poses]
    found = refuted(Unknowns(poses, lines, anchors), reach, Rays(scans, scanner), margin)
    balance = np.zeros(count)
    for scan, pose in zip(scans, poses, strict=True):
        at = compose(pose, scanner.pose_robot)
        for k in range(count):
            n, t, ended, passed = normals(alpha[k : k + 1])[0], directions(alpha[k : k + 1])[0], 0, 0
            for bearing, range_m in zip(scan.bearings_rad, scan.ranges_m, strict=True):
                ahead = np.array([np.cos(at[2] + bearing), np.sin(at[2] + bearing)])
                away = n @ (anchors[k] - at[:2])
                if away <= 0.02 or ahead @ n <= 0.05:
                    continue
                s = t @ (at[:2] + away / (ahead @ n) * ahead - anchors[k])
                beyond = (range_m - away / (ahead @ n)) * (ahead @ n)
                if reach[k, 0] + margin < s < reach[k, 1] - margin:
                    ended, passed = ended + (abs(beyond) <= margin), passed + (beyond > margin)
            balance[k] += np.sign(ended - passed)
    np.testing.assert_array_equal(found, balance < 0)
    assert found.any()
    assert not found.all()
