"""Lines and segments against shapely and against the points that they pass through."""

import numpy as np
import pytest
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.geometry.line_kernels import intersect
from chainslam.slam.geometry.lines import directions, distance_to_segments, lines_to_world, normals, project, through
from chainslam.slam.geometry.poses import J, to_world

seeds = st.integers(0, 2**32)
few = settings(max_examples=25, deadline=None, derandomize=True)


def random_segments(rng, count=8):
    segments = rng.uniform(-5, 5, (count, 2, 2))
    return segments[np.hypot(*(segments[:, 1] - segments[:, 0]).T) > 0.1]


def off(points, lines):
    """Return n(alpha)·x - r for points (n, 2, 2) of their lines."""
    return np.einsum("nd,npd->np", normals(lines[:, 0]), points) - lines[:, 1:]


@few
@given(seeds)
def test_a_line_through_a_segment_holds_both_its_ends(seed):
    segments = random_segments(np.random.default_rng(seed))
    np.testing.assert_allclose(off(segments, through(segments)), 0.0, atol=1e-12)


@few
@given(seeds)
def test_the_normal_points_to_the_right_of_travel_and_the_free_side_is_on_the_left(seed):
    segments = random_segments(np.random.default_rng(seed))
    along = segments[:, 1] - segments[:, 0]
    along /= np.hypot(along[:, 0], along[:, 1])[:, None]
    lines = through(segments)
    np.testing.assert_allclose(normals(lines[:, 0]), along @ -J.T, atol=1e-12)
    np.testing.assert_allclose(directions(lines[:, 0]), along, atol=1e-12)


@few
@given(seeds)
def test_a_segment_and_its_reverse_lie_on_one_line_seen_from_two_sides(seed):
    segments = random_segments(np.random.default_rng(seed))
    one, other = through(segments), through(segments[:, ::-1])
    np.testing.assert_allclose(normals(one[:, 0]), -normals(other[:, 0]), atol=1e-12)
    np.testing.assert_allclose(one[:, 1], -other[:, 1], atol=1e-12)


@few
@given(seeds)
def test_lines_move_to_the_world_as_their_points_do(seed):
    rng = np.random.default_rng(seed)
    segments, pose = random_segments(rng), rng.uniform([-30, -30, -7], [30, 30, 7])
    moved = lines_to_world(through(segments), pose)
    np.testing.assert_allclose(off(to_world(segments, pose), moved), 0.0, atol=1e-11)
    world = through(to_world(segments, pose))
    np.testing.assert_allclose(normals(moved[:, 0]), normals(world[:, 0]), atol=1e-11)
    np.testing.assert_allclose(moved[:, 1], world[:, 1], atol=1e-11)


@few
@given(seeds)
def test_the_foot_of_a_perpendicular_is_the_nearest_point_of_the_line(seed):
    rng = np.random.default_rng(seed)
    segments = random_segments(rng)
    points, lines = rng.uniform(-5, 5, (len(segments), 2)), through(segments)
    feet = project(points, lines)
    np.testing.assert_allclose(off(feet[:, None], lines), 0.0, atol=1e-12)
    gap = np.hypot(*(feet - points).T)
    for shift in (-0.3, 1e-3, 0.4):
        assert np.all(np.hypot(*(feet + shift * directions(lines[:, 0]) - points).T) > gap)


@few
@given(seeds)
def test_the_intersection_of_lines_is_shapelys(seed):
    rng = np.random.default_rng(seed)
    segments = random_segments(rng, 12)
    a, b = through(segments[:5]), through(segments[5:10])
    points, parallel = intersect(a, b)
    for k in range(len(a)):
        turn = abs(np.sin(a[k, 0] - b[k, 0]))
        assert parallel[k] == (turn < 0.05)
        if parallel[k]:
            continue
        long = [
            shapely.LineString(line[1] * normals(line[:1]) + np.array([[-1000.0], [1000.0]]) * directions(line[:1]))
            for line in (a[k], b[k])
        ]
        crossing = shapely.intersection(*long)
        if not crossing.is_empty:
            np.testing.assert_allclose(points[k], [crossing.x, crossing.y], atol=1e-7)


@pytest.mark.parametrize("turn", [0.0, np.pi, 0.049, -0.049, np.pi - 0.04])
def test_lines_that_are_nearly_parallel_are_said_to_be(turn):
    points, parallel = intersect(np.array([[0.3, 1.0]]), np.array([[0.3 + turn, 2.0]]))
    assert parallel[0]
    assert np.all(np.isfinite(points))


@few
@given(seeds)
def test_the_distance_to_segments_is_shapelys(seed):
    rng = np.random.default_rng(seed)
    points, segments = rng.uniform(-6, 6, (9, 2)), rng.uniform(-5, 5, (7, 2, 2))
    expected = shapely.distance(shapely.points(points)[:, None], shapely.linestrings(segments)[None])
    np.testing.assert_allclose(distance_to_segments(points, segments), expected, atol=1e-10)


def test_the_distance_to_a_segment_of_no_length_is_that_to_its_point():
    at = np.array([[[1.0, 2.0], [1.0, 2.0]]])
    assert distance_to_segments(np.array([[4.0, 6.0]]), at)[0, 0] == pytest.approx(5.0)


def test_no_segments_and_no_points_give_empty_tables():
    assert distance_to_segments(np.zeros((3, 2)), np.zeros((0, 2, 2))).shape == (3, 0)
    assert distance_to_segments(np.zeros((0, 2)), np.ones((4, 2, 2))).shape == (0, 4)
    assert through(np.zeros((0, 2, 2))).shape == (0, 2)
