import numpy as np
import pytest
import shapely

from chainslam.sim.worlds import WORLDS, World, load

TABLE_1 = {("A", "B"): 6.50, ("A", "C"): 8.35, ("B", "C"): 7.60}
"""Table 1 of the paper, measured by hand, m."""


@pytest.fixture(params=sorted(WORLDS))
def world(request: pytest.FixtureRequest) -> World:
    return load(request.param)


def test_corners_of_figure_8_stand_as_far_apart_as_table_1_says():
    labels = load("paper-fig8").labels
    for (a, b), metres in TABLE_1.items():
        assert np.hypot(*np.subtract(labels[a], labels[b])) == pytest.approx(metres, abs=1e-3)


@pytest.mark.parametrize("name", ["paper-fig8", "paper-fig9"])
def test_labelled_corners_are_corners_of_faces(name):
    world = load(name)
    corners = world.faces[:, 0]
    for at in world.labels.values():
        assert np.min(np.hypot(*(corners - at).T)) < 1e-4


def test_labels_of_figure_9_are_its_two_farthest_corners():
    world = load("paper-fig9")
    corners = world.faces[:, 0]
    apart = np.hypot(*np.moveaxis(corners[:, None] - corners, -1, 0))
    assert np.hypot(*np.subtract(world.labels["A"], world.labels["B"])) == pytest.approx(apart.max(), abs=1e-3)


def test_free_space_is_one_valid_region_and_the_start_has_room(world):
    at = shapely.Point(world.start[:2])
    assert world.free.is_valid
    assert world.free.contains(at)
    assert world.free.exterior.distance(at) >= 0.4
    assert all(ring.distance(at) >= 0.4 for ring in world.free.interiors)


def test_every_face_has_free_space_on_its_left_and_wall_on_its_right(world):
    middle = world.faces.mean(axis=1)
    along = world.faces[:, 1] - world.faces[:, 0]
    left = np.stack([-along[:, 1], along[:, 0]], axis=1) / np.hypot(*along.T)[:, None]
    assert np.all(shapely.contains(world.free, shapely.points(middle + 0.02 * left)))
    assert not np.any(shapely.contains(world.free, shapely.points(middle - 0.02 * left)))


def test_faces_are_closed_rings_without_collinear_neighbours(world):
    for ring in range(world.face_rings.max() + 1):
        faces = world.faces[world.face_rings == ring]
        np.testing.assert_array_equal(faces[:, 1], np.roll(faces[:, 0], -1, axis=0))
        along = faces[:, 1] - faces[:, 0]
        along /= np.hypot(*along.T)[:, None]
        turn = along[:, 0] * np.roll(along[:, 1], -1) - along[:, 1] * np.roll(along[:, 0], -1)
        assert np.all(np.abs(turn) > 1e-3)


def test_the_robot_reaches_all_of_the_free_space_and_sees_every_contour(world):
    contour = world.reachable_contour()
    assert world.reachable().area > 0.55 * world.free.area
    assert contour.contours == world.face_rings.max() + 1
    assert contour.length_m == pytest.approx(np.sum(np.hypot(*(world.faces[:, 1] - world.faces[:, 0]).T)), rel=1e-6)


def test_passages_of_figure_8_are_wide_enough_to_drive_through():
    world = load("paper-fig8")
    assert len(world.reachable(0.44).interiors) == 1


def test_hall_has_obstacles_beyond_the_range_of_any_other_wall():
    world = load("hall")
    outer = world.free.exterior
    assert sum(outer.distance(ring) > 4 for ring in world.free.interiors) >= 2
