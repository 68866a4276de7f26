"""What short faces and misfits add to a covariance: against information summed along the face, and against scans."""

from dataclasses import replace

import numpy as np
import pytest
import shapely

from sim.lidar import LidarConfig, RangeFinder
from slam.backends import BACKENDS
from slam.config import MapperConfig
from slam.estimation.backend import Belief, Joint
from slam.extraction.extract import extract
from slam.extraction.straightness import StraightnessConfig, cov_of_bows, cov_of_faces
from slam.extraction.straightness_kernels import edge_cov
from slam.geometry.lines import normals, through
from slam.geometry.poses import wrap
from slam.map.reliability import ReliabilityConfig
from slam.map.stochastic_map import StochasticMap
from slam.mapper import Mapper
from slam.robot import Odometry, Scan


@pytest.mark.parametrize(("length", "middle"), [(0.1, 0.0), (0.4, 1.3), (0.2, -2.0)])
def test_the_covariance_of_an_edge_is_that_of_one_point_spread_along_it(length, middle):
    """Information about (direction, distance at 0) of a point with variance v at x is (x, 1)' (x, 1) / v."""
    x = middle + length * (np.arange(20_000) + 0.5) / 20_000 - 0.5 * length
    rows = np.column_stack([-x, np.ones_like(x)])  # turning the wall moves the point at x off by -x
    expected = np.linalg.inv(rows.T @ rows / (len(x) * 0.01**2))
    (found,) = edge_cov(np.array([0.01**2]), np.array([length]), np.array([middle]))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-12)


def room_of_pilasters(rng):
    """Return the faces of a room in whose walls stand pilasters and niches of 6 to 15 cm, three a metre."""
    room = shapely.box(0, 0, 4, 3)
    for at in np.arange(0.5, 3.6, 0.6) + rng.uniform(-0.1, 0.1, 6):
        width, depth = rng.uniform(0.06, 0.15, 2)
        room = room.difference(shapely.box(at, 0.0, at + width, depth))
        room = room.union(shapely.box(at, 3.0 - 1e-6, at + width, 3.0 + depth))
    ring = shapely.get_coordinates(shapely.orient_polygons(room).exterior)
    return np.stack([ring[:-1], ring[1:]], axis=1)


def short_segments(rng):
    """Return the NEES over 2 of short segments, as extracted and as told, and which of them are of several faces."""
    values, mixed = [], []
    for _ in range(6):
        faces = room_of_pilasters(rng)
        finder, lines = RangeFinder(faces, LidarConfig()), through(faces)
        for _ in range(25):
            pose = np.append(rng.uniform([0.6, 0.6], [3.4, 2.4]), rng.uniform(-np.pi, np.pi))
            ranges, hit = finder.cast(pose)
            scan = Scan(finder.bearings_rad, ranges + 0.01 * rng.standard_normal(len(ranges)), 0.01, 4.0, 0.0)
            segments = extract(scan)
            segments = segments.take((segments.lengths_m < 0.2) & (segments.beam_counts >= 4))
            told = segments.cov + cov_of_faces(segments)
            for k, (a, b) in enumerate(segments.beams):
                on = hit[np.arange(a, b + 1 + len(hit) * (b < a)) % len(hit)]
                alpha, r = lines[np.bincount(on[on >= 0]).argmax()]
                turn, at = segments.lines[k, 0] + pose[2] - alpha, segments.lines[k, 1] + normals(alpha) @ pose[:2]
                error = np.array([wrap(turn), at - r])
                values.append([error @ np.linalg.solve(cov[k], error) / 2.0 for cov in (segments.cov, told)])
                mixed.append(len(set(on)) > 1)
    return np.array(values), np.array(mixed)


def test_among_short_faces_what_is_told_holds_for_those_of_one_face_and_nearly_for_the_rest():
    """A room far worse than a flat: four short segments in ten lie across a corner."""
    values, mixed = short_segments(np.random.default_rng(3))
    assert mixed.mean() > 0.3
    as_extracted, told = values.T
    assert 0.5 < told[~mixed].mean() < 1.5 < as_extracted[~mixed].mean()
    assert np.median(told) < 0.8 < 1.5 < np.median(as_extracted)
    assert np.quantile(told, 0.8) < 0.4 * np.quantile(as_extracted, 0.8)


def test_a_wall_that_bows_lies_and_points_otherwise_where_another_part_of_it_is_in_sight():
    """Draws of a wall turned about the middle of the part in sight, and shifted, as the scan's (alpha, r)."""
    scan = Scan(np.linspace(0.2, 0.8, 30), 2.0 / np.cos(np.linspace(0.2, 0.8, 30)), 0.002, 6.0, 0.0)
    segments, bow = extract(scan), StraightnessConfig(bow_rad=0.01, bow_m=0.02)
    (alpha, _), middle = segments.lines[0], segments.ends[0].mean(axis=0)
    rng = np.random.default_rng(1)
    turned = alpha + bow.bow_rad * rng.standard_normal(50_000)
    r = normals(turned) @ middle + bow.bow_m * rng.standard_normal(50_000)
    drawn = np.cov(turned, r)
    sigma = np.sqrt(np.diag(drawn))
    (found,) = cov_of_bows(segments, bow)
    np.testing.assert_allclose(found / np.outer(sigma, sigma), drawn / np.outer(sigma, sigma), atol=0.02)
    np.testing.assert_allclose(cov_of_faces(segments, bow), cov_of_faces(segments) + cov_of_bows(segments, bow))
    assert not cov_of_bows(segments).any()


@pytest.mark.parametrize("looks", [1, 3])
def test_a_map_of_walls_that_bow_knows_none_better_than_its_looks_allow(looks):
    bow = StraightnessConfig(bow_rad=0.02, bow_m=0.05)
    config = MapperConfig()
    config = replace(config, walls=replace(config.walls, reliability=ReliabilityConfig(straightness=bow)))
    mapper = Mapper(BACKENDS["full-ekf"].make(np.zeros(3), 1e-12 * np.eye(3)), config)
    bearings = np.linspace(-0.5, 0.5, 60)
    for look in range(looks):
        if look:
            mapper.predict(Odometry(np.zeros(3), 1e-14 * np.eye(3)))
        mapper.step(Scan(bearings, 2.0 / np.cos(bearings), 0.002, 6.0, 0.0))
    belief = mapper.belief
    sigma = np.sqrt(np.diag(belief.joint(belief.ids).cov)[3:])
    np.testing.assert_allclose(sigma, np.array([0.02, 0.05]) / np.sqrt(looks), rtol=0.05)


def test_a_map_tells_how_far_walls_are_off_in_whatever_order_it_is_asked():
    rng = np.random.default_rng(0)
    root = rng.normal(size=(9, 9))
    whole = Joint(rng.normal(size=9), root @ root.T, rng.normal(size=(3, 2)))
    ids = np.array([4, 7, 9])
    belief = Belief(whole.mean[:3], whole.cov[:3, :3], ids, whole.anchors, whole.mean[3:].reshape(-1, 2),
                    lambda asked: whole.take(np.searchsorted(ids, asked)))  # fmt: skip
    no, blocks = (
        np.zeros(3, dtype=bool),
        edge_cov(np.array([1.0, 2.0, 3.0]), np.ones(3), np.array([0.5, 0.0, -1.0])),
    )
    walls = StochasticMap(belief, np.tile([-1.0, 1.0], (3, 1)), np.full(3, 5), no, no, off_line_cov=blocks)
    for asked in ([4, 7, 9], [9, 4], [7], []):
        rows = np.searchsorted(ids, np.array(asked, dtype=np.int64))
        expected = whole.take(rows).cov.copy()
        for k, row in enumerate(rows):
            expected[3 + 2 * k : 5 + 2 * k, 3 + 2 * k : 5 + 2 * k] += blocks[row]
        np.testing.assert_allclose(walls.told.belief.joint(np.array(asked, dtype=np.int64)).cov, expected)
        np.testing.assert_array_equal(walls.belief.joint(np.array(asked, dtype=np.int64)).cov, whole.take(rows).cov)
    assert replace(walls, off_line_cov=None).told.belief is belief
