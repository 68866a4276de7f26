"""What short faces and misfits add to a covariance: against information summed along the face, and against scans."""

from dataclasses import replace

import numpy as np
import pytest
import scipy.stats
import shapely

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.backends import BACKENDS
from chainslam.slam.config import MapperConfig
from chainslam.slam.estimation.backend import Belief, Joint
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.straightness import StraightnessConfig, cov_of_bows, cov_of_faces, cov_of_misfits
from chainslam.slam.extraction.straightness_kernels import edge_cov, edge_variance, faces_cov, misfit_variances
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.map.reliability import ReliabilityConfig, are_clear, as_told
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Scan


@pytest.mark.parametrize(("length", "middle"), [(0.1, 0.0), (0.4, 1.3), (0.2, -2.0)])
def test_the_covariance_of_an_edge_is_that_of_one_point_spread_along_it(length, middle):
    """Information about (direction, distance at 0) of a point with variance v at x is (x, 1)' (x, 1) / v."""
    x = middle + length * (np.arange(20_000) + 0.5) / 20_000 - 0.5 * length
    rows = np.column_stack([-x, np.ones_like(x)])  # turning the wall moves the point at x off by -x
    expected = np.linalg.inv(rows.T @ rows / (len(x) * 0.01**2))
    (found,) = edge_cov(np.array([0.01**2]), np.array([length]), np.array([middle]))
    np.testing.assert_allclose(found, expected, rtol=1e-6, atol=1e-12)


def test_long_faces_are_on_their_lines():
    sigmas = np.sqrt([edge_variance(length, 0.01, 0.2) for length in (0.0, 0.1, 0.2, 0.4, 1.0, 4.0)])
    assert sigmas[0] == 0.01
    assert sigmas[2] == 0.005
    assert (np.diff(sigmas) < 0.0).all()
    assert sigmas[4] < 2e-5, "far below what a hundred beams tell"
    assert edge_variance(0.05, 0.0, 0.2) == edge_variance(1.0, 0.0, 0.2) == 0.0


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


def test_a_short_face_is_not_clear_and_moves_the_estimate_by_no_more_than_it_is_told():
    scan = Scan(np.linspace(-0.3, 0.3, 13), 1.0 / np.cos(np.linspace(-0.3, 0.3, 13)), 0.002, 4.0, 0.0)
    (segments,) = [extract(scan)]
    assert len(segments) == 1
    long, short = segments, replace(segments, ends=0.2 * segments.ends + [0.8, 0.0])
    config = ReliabilityConfig()
    assert are_clear(long, config).all()
    assert not are_clear(short, config).any()
    np.testing.assert_allclose(as_told(short.cov, short, config), short.cov + cov_of_faces(short))
    np.testing.assert_allclose(as_told(long.cov, long, config), long.cov, rtol=0.2)


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


def over_a_jog(rng, jog_m, count=200):
    """Return segments across a jog between two parallel faces, as fitted, and their errors of direction, rad.

    Each has two beams on the end of a wall and four on a face 0.3 m behind it, which stands off by `jog_m`.
    """
    along, off = np.array([0.0, 0.06, 0.36, 0.4, 0.44, 0.48]), jog_m * np.array([0.0, 0.0, 1.0, 1.0, 1.0, 1.0])
    sigma, x = 0.01, np.column_stack([np.ones(6), along])
    inverse = np.linalg.inv(x.T @ x)
    cov = np.tile(sigma**2 * np.array([[inverse[1, 1], inverse[0, 1]], [inverse[0, 1], inverse[0, 0]]]), (count, 1, 1))
    draws = off[:, None] + sigma * rng.standard_normal((6, count))
    fits = (inverse @ x.T @ draws).T
    chi2 = ((draws - x @ fits.T) ** 2).sum(axis=0) / sigma**2
    return cov, chi2, fits[:, 1]


def test_a_segment_over_two_faces_is_as_far_off_as_its_own_residuals_say():
    """What the fit states of its direction is a fifth of the error; with its misfit three sigmas hold it."""
    cov, chi2, turned = over_a_jog(np.random.default_rng(2), 0.13)
    shown = misfit_variances(cov, chi2, np.full(len(cov), 6), 3.0)
    seen = shown > 0.0
    stated = cov[:, 0, 0] + 12.0 * shown / 0.48**2
    assert seen.mean() > 0.5
    assert np.abs(turned).min() > 4.0 * np.sqrt(cov[0, 0, 0])
    assert (np.abs(turned[seen]) < 3.0 * np.sqrt(stated[seen])).all()


def test_a_segment_of_one_face_shows_a_misfit_as_rarely_as_chance_has_it():
    cov, chi2, _ = over_a_jog(np.random.default_rng(3), 0.0, 20_000)
    shown = misfit_variances(cov, chi2, np.full(len(cov), 6), 3.0)
    expected = scipy.stats.chi2.sf(4.0 + 3.0 * np.sqrt(8.0), 4)
    assert np.mean(shown > 0.0) == pytest.approx(expected, abs=4.0 * np.sqrt(expected / len(cov)))


def test_a_misfit_is_twice_what_the_residuals_show_beyond_the_noise():
    """Ten beams of 10 mm, all of the excess in one number: sum of squares 40 variances, 32 of them beyond noise."""
    variance = 0.01**2
    cov = np.array([[[0.01, 0.002], [0.002, 0.0004 + variance / 10]]])
    (found,) = misfit_variances(cov, np.array([40.0]), np.array([10]), 3.0)
    assert found == pytest.approx(4.0 * 32.0 * variance / 10)
    assert misfit_variances(cov, np.array([19.9]), np.array([10]), 3.0) == 0.0
    lines, ends = np.array([[0.0, 1.0]]), np.array([[[1.0, -0.5], [1.0, 0.5]]])
    (told,) = faces_cov(lines, ends, cov, np.array([40.0]), np.array([10]), 3.0, 0.0, 0.2)
    np.testing.assert_allclose(told, [[12.0 * found, 0.0], [0.0, found]], atol=1e-12)


def test_a_segment_with_a_misfit_of_its_own_moves_no_estimate():
    scan = Scan(np.linspace(-0.3, 0.3, 13), 1.0 / np.cos(np.linspace(-0.3, 0.3, 13)), 0.002, 4.0, 0.0)
    straight = extract(scan)
    bent = replace(straight, chi2=np.array([3000.0]))
    assert are_clear(straight).all()
    assert not are_clear(bent).any()
    np.testing.assert_allclose(cov_of_misfits(straight), 0.0)
    np.testing.assert_allclose(cov_of_faces(bent), cov_of_faces(straight) + cov_of_misfits(bent), rtol=1e-9)


def test_a_wall_that_begins_by_a_segment_with_a_misfit_is_as_uncertain_as_that():
    """Sixty beams two sigmas before and behind a wall in turn: four times the chi-square of a straight one."""
    bearings = np.linspace(-0.5, 0.5, 60)
    ranges = (2.0 + 0.004 * np.tile([1.0, -1.0], 30)) / np.cos(bearings)
    scan = Scan(bearings, ranges, 0.002, 6.0, 0.0)
    segments = extract(scan)
    assert len(segments) == 1
    mapper = Mapper(BACKENDS["full-ekf"].make(np.zeros(3), 1e-12 * np.eye(3)), MapperConfig())
    mapper.step(scan)
    turn = mapper.belief.joint(mapper.belief.ids).cov[3, 3]
    assert turn == pytest.approx(segments.cov[0, 0, 0] + cov_of_misfits(segments)[0, 0, 0], rel=1e-3)
    assert turn > 10.0 * segments.cov[0, 0, 0]
