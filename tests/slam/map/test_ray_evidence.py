"""Beams against walls, one by one with shapely; what walls and seams make of it."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.extraction.config import ExtractionConfig
from chainslam.slam.extraction.extract import extract
from chainslam.slam.extraction.visible_extent import sure_pieces
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.map.kernels.ray_evidence import RayEvidence, ray_evidence
from chainslam.slam.robot import Scan


def faces_of(polygon):
    rings = [shapely.get_coordinates(ring) for ring in (polygon.exterior, *polygon.interiors)]
    return np.concatenate([np.stack([ring[:-1], ring[1:]], axis=1) for ring in rings])


def scan_from(faces, pose, rng=None, beams=180):
    finder = RangeFinder(faces, LidarConfig(beams=beams))
    ranges = finder.cast(np.asarray(pose, dtype=float))[0]
    if rng is not None:
        ranges = ranges + 0.01 * rng.standard_normal(len(ranges))
    return Scan(finder.bearings_rad, ranges, 0.01, 4.0, 0.0)


def random_place(rng):
    room = shapely.orient_polygons(shapely.box(0, 0, 5, 4).difference(shapely.box(2, 1.5, 2.6, 2.6)))
    while True:
        pose = rng.uniform([0.3, 0.3, -3], [4.7, 3.7, 3])
        if room.buffer(-0.25).contains(shapely.Point(pose[:2])):
            return room, pose


@pytest.mark.parametrize("seed", range(8))
def test_each_beam_hits_passes_or_falls_short_as_a_ray_traced_alone_does(seed):
    rng = np.random.default_rng(seed)
    room, pose = random_place(rng)
    scan = scan_from(faces_of(room), pose, rng)
    segments, margin = rng.uniform([0, 0], [5, 4], (6, 2, 2)), 0.07
    lines, anchors = through(segments), segments.mean(axis=1)
    means = np.column_stack([lines[:, 0], np.einsum("nd,nd->n", normals(lines[:, 0]), segments[:, 0] - anchors)])
    found = ray_evidence(scan, pose, anchors, means)
    hits, passes = found.hits(margin), found.passes(margin)
    compared = 0
    for i, (alpha, r) in enumerate(lines):
        n, t = np.array([np.cos(alpha), np.sin(alpha)]), np.array([-np.sin(alpha), np.cos(alpha)])
        long = shapely.LineString([r * n - 100 * t, r * n + 100 * t])
        for k in range(0, 180, 3):
            bearing = scan.bearings_rad[k] + pose[2]
            beam = np.array([np.cos(bearing), np.sin(bearing)])
            crossing = shapely.intersection(shapely.LineString([pose[:2], pose[:2] + 60 * beam]), long)
            if beam @ n < 0.06 or r - n @ pose[:2] < 0.03 or crossing.is_empty:
                if beam @ n < 0.0:  # seen from behind, or leading away
                    assert not hits[i, k]
                    assert not passes[i, k]
                continue
            at = np.array([crossing.x, crossing.y])
            assert found.along[i, k] == pytest.approx(t @ (at - anchors[i]), abs=1e-6)
            here, *beside = (scan.ranges_m[n % 180] for n in (k, k - 1, k + 1))
            # A return that is missing beside one that is not says nothing.
            reach = here if np.isfinite(here) else 4.0 if np.isinf(beside).all() else 0.0
            end = pose[:2] + reach * beam
            across = end @ n - r
            if abs(abs(across) - margin) < 1e-9:
                continue
            assert passes[i, k] == (across > margin)
            assert hits[i, k] == (np.isfinite(here) and abs(across) <= margin)
            compared += 1
    assert compared > 20


@settings(max_examples=60, deadline=None, derandomize=True)
@given(seed=st.integers(0, 2**32))
def test_which_beams_end_on_lines_and_which_cross_them_well_inside_of_walls(seed):
    """In quarters of a metre, so that many lie on a bound."""
    rng = np.random.default_rng(seed)
    along, across = rng.integers(-5, 6, (2, 3, 7)) / 4.0
    along[:, 0] = across[:, 0] = np.nan
    extents, rays = rng.integers(-5, 6, (3, 2)) / 4.0, RayEvidence(along, across, rng.random(7) < 0.7)
    hits, inside, between = rays.hits(0.5), rays.between(extents, 0.25), rays.between(extents)
    for line, (low, high) in enumerate(extents):
        for beam, (at, beyond) in enumerate(zip(along[line], across[line], strict=True)):
            assert hits[line, beam] == (rays.returned[beam] and -0.5 <= beyond <= 0.5)
            assert inside[line, beam] == (at > low + 0.25 and at < high - 0.25)
            assert between[line, beam] == (at > low and at < high)


@pytest.mark.parametrize("seed", range(8))
def test_sure_pieces_never_lengthen_a_segment(seed):
    rng = np.random.default_rng(seed)
    room, pose = random_place(rng)
    scan = scan_from(faces_of(room), pose, rng)
    segments = extract(scan)
    sure = sure_pieces(segments, scan, ExtractionConfig())
    np.testing.assert_array_equal(sure.lines, segments.lines)
    np.testing.assert_array_equal(sure.beams, segments.beams)
    t = np.stack([-np.sin(segments.lines[:, 0]), np.cos(segments.lines[:, 0])], axis=-1)
    before, after = (np.einsum("ned,nd->ne", s.ends, t) for s in (segments, sure))
    leap = np.hypot(*(sure.ends - segments.ends).reshape(-1, 2).T).reshape(-1, 2) > 1e-12
    assert np.all(after[:, 0] >= before[:, 0] - 1e-9)
    assert np.all(after[:, 1] <= before[:, 1] + 1e-9)
    assert np.all(after[:, 0] <= after[:, 1] + 1e-9)
    assert np.all(sure.at_corner[~leap] == segments.at_corner[~leap])


def test_a_wall_seen_at_a_grazing_angle_is_sure_only_where_its_beams_stand_close():
    wall = np.array([[[0.3, -0.5], [4.0, -0.5]]])
    scan = scan_from(wall, [0.0, 0.0, 0.0])
    config = ExtractionConfig()
    (end,) = sure_pieces(extract(scan), scan, config).ends[:, 1]
    step = scan.bearings_rad[1] - scan.bearings_rad[0]
    bearing = np.arctan2(end[1], end[0])
    beyond = 0.5 / np.tan(-(bearing + step))
    assert beyond - end[0] == pytest.approx(config.shared.door_m, rel=0.2)


@pytest.mark.parametrize(("leap_m", "is_believed"), [(0.05, True), (0.1, False)])
def test_a_corner_far_beyond_the_last_beam_was_not_seen(leap_m, is_believed):
    """The lines of two walls cross there, and something may hide between two beams."""
    scan = scan_from(np.array([[[1.0, -0.6], [1.0, 0.6]]]), [0.0, 0.0, 0.0])
    segments = extract(scan)
    last = np.tan(scan.bearings_rad[segments.beams[0, 1]])
    segments.ends[0, 1] = [1.0, last + leap_m]
    segments.at_corner[0, 1] = True
    sure = sure_pieces(segments, scan, ExtractionConfig())
    np.testing.assert_allclose(sure.ends[0, 1], [1.0, last + leap_m * is_believed], atol=1e-6)
    assert sure.at_corner[0, 1] == is_believed


def test_a_wall_across_the_seam_has_as_many_beams_as_anywhere_else():
    """Turn the robot: the same wall crosses the seam or does not; its beams are those that end on it."""
    room = faces_of(shapely.orient_polygons(shapely.box(0, 0, 3, 2.4)))
    for heading in np.linspace(-np.pi, np.pi, 17):
        scan = scan_from(room, [1.3, 1.1, heading])
        segments = extract(scan)
        assert len(segments) == 4
        for row in range(4):
            alpha, r = segments.lines[row]
            first, last = segments.beams[row]
            beams = len(scan.bearings_rad)
            mine = (np.arange(beams) - first) % beams <= (last - first) % beams
            across = scan.ranges_m * np.cos(scan.bearings_rad - alpha) - r
            assert np.abs(across[mine]).max() < 1e-6
            assert mine.sum() >= np.count_nonzero(np.abs(across) < 1e-6) - 4
