"""The reachable contour against brute force: sight lines from a grid of reachable places to points along the faces."""

import numpy as np
import pytest
import shapely

from chainslam.sim.worlds import World, load
from chainslam.sim.worlds.drawing import Drawing
from chainslam.sim.worlds.solid import build

RADIUS_M, RANGE_M, GRID_M, PITCH_M = 0.2, 4.0, 0.08, 0.1


def _box_with(*obstacles: shapely.Polygon, size: float = 6.0) -> World:
    outside = shapely.box(-0.3, -0.3, size + 0.3, size + 0.3).difference(shapely.box(0, 0, size, size))
    return build("box", Drawing(solids=(outside, *obstacles), start=np.array([1.0, 1.0, 0.0])))


def _narrow_closet() -> World:
    """A closet behind a gap of 0.3 m: seen into, never entered."""
    return _box_with(shapely.box(4.0, 0, 4.1, 2.0), shapely.box(4.0, 2.3, 4.1, 6.0))


def _wedge() -> World:
    """Two slanted obstacles with a crack between them through which a sliver is seen."""
    return _box_with(
        shapely.Polygon([(3, 0), (3.6, 0), (4.2, 2.9), (3.6, 2.9)]), shapely.Polygon([(3.9, 6), (3.3, 6), (3.8, 3.0)])
    )


def _far_wall() -> World:
    """A room whose far end lies beyond the range behind a gap."""
    return _box_with(shapely.box(5.0, 0, 5.2, 5.0), shapely.box(5.0, 5.25, 5.2, 12.0), size=12.0)


def _brute_force(world: World) -> np.ndarray:
    """Return the seen length of each face, m."""
    region = world.reachable(RADIUS_M)
    x0, y0, x1, y1 = region.bounds
    grid = np.stack(np.meshgrid(np.arange(x0, x1, GRID_M), np.arange(y0, y1, GRID_M)), axis=-1).reshape(-1, 2)
    edge = [shapely.line_interpolate_point(ring, np.arange(0, ring.length, 0.05)) for ring in shapely.get_rings(region)]
    places = np.concatenate([grid[shapely.contains(region, shapely.points(grid))], shapely.get_coordinates(edge)])
    shapely.prepare(world.free)
    seen = []
    for a, b in world.faces:
        length = np.hypot(*(b - a))
        count = int(np.ceil(length / PITCH_M))
        left = np.array([a[1] - b[1], b[0] - a[0]]) / length
        points = a + ((np.arange(count) + 0.5) / count)[:, None] * (b - a) + 1e-6 * left
        hits = 0
        for point in points:
            near = places[np.hypot(*(places - point).T) <= RANGE_M]
            lines = shapely.linestrings(np.stack([np.broadcast_to(point, near.shape), near], axis=1))
            hits += bool(np.any(shapely.contains_properly(world.free, lines)))
        seen.append(hits * length / count)
    return np.array(seen)


@pytest.mark.parametrize("world", [_narrow_closet(), _wedge(), _far_wall()], ids=["closet", "wedge", "far wall"])
def test_contour_equals_brute_force(world):
    contour = world.reachable_contour(RADIUS_M, RANGE_M)
    fast = np.bincount(contour.face, contour.span_m[:, 1] - contour.span_m[:, 0], minlength=len(world.faces))
    slow = _brute_force(world)
    np.testing.assert_allclose(fast, slow, atol=0.15)
    lengths = np.hypot(*(world.faces[:, 1] - world.faces[:, 0]).T)
    assert np.sum(lengths - slow) > 0.3, "the example must hide something"


def test_intervals_lie_in_order_within_their_faces():
    world = _narrow_closet()
    contour = world.reachable_contour()
    lengths = np.hypot(*(world.faces[:, 1] - world.faces[:, 0]).T)
    assert np.all(np.diff(contour.face) >= 0)
    assert np.all(contour.span_m[:, 0] < contour.span_m[:, 1])
    assert np.all(contour.span_m[:, 0] >= 0)
    assert np.all(contour.span_m[:, 1] <= lengths[contour.face] + 1e-9)
    np.testing.assert_allclose(
        np.hypot(*(contour.segments[:, 1] - contour.segments[:, 0]).T), contour.span_m[:, 1] - contour.span_m[:, 0]
    )


def test_the_wall_of_a_big_empty_hall_is_seen_although_the_start_sees_nothing():
    hall = build(
        "empty",
        Drawing(
            solids=(shapely.box(-1, -1, 31, 31).difference(shapely.box(0, 0, 30, 30)),), start=np.array([15.0, 15, 0])
        ),
    )
    assert hall.reachable_contour().length_m == pytest.approx(120.0)


def test_turning_the_world_turns_its_contour():
    from shapely.affinity import rotate

    straight = _wedge()
    drawing = Drawing(
        solids=(rotate(shapely.box(-1, -1, 7, 7).difference(straight.free), 33, origin=(0, 0)),),
        start=np.array([*shapely.get_coordinates(rotate(shapely.Point(1, 1), 33, origin=(0, 0)))[0], 0.0]),
    )
    assert build("turned", drawing).reachable_contour().length_m == pytest.approx(
        straight.reachable_contour().length_m, abs=0.02
    )


def test_a_wider_robot_and_a_shorter_range_never_see_more():
    world = load("rooms")
    whole = world.reachable_contour().length_m
    assert world.reachable_contour(radius_m=0.44).length_m < whole
    assert world.reachable_contour(range_m=0.5).length_m <= whole + 1e-6
