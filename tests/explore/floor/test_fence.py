"""A fence: nothing beyond it is floor, and nothing there is driven to, looked for or scored."""

import json
from dataclasses import replace

import numpy as np
import pytest
import shapely

import chainslam
from chainslam.experiments.artifacts.fences import fence_of
from chainslam.experiments.commands.cli import main
from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.sim.worlds import World
from chainslam.slam.robot import Scan

BOX = ((0.0, 0.0), (6.0, 0.0), (6.0, 5.0), (0.0, 5.0))


def seen(fence, poses):
    space = FreeSpace(FreeSpaceConfig(fence=fence))
    bearings = np.linspace(-np.pi, np.pi, 180, endpoint=False)
    for pose in poses:
        space.integrate(np.array(pose), Scan(bearings, np.full(180, 3.0), 0.01, 4.0, 0.0))
    return space


def test_cells_beyond_the_fence_are_no_floor_however_the_grid_grows():
    space = seen(BOX, [[1.0, 1.0, 0.0], [5.0, 4.0, 0.0], [12.0, 4.0, 0.0]])
    cells = np.argwhere(np.ones(space.shape, dtype=bool))
    within = shapely.contains_xy(shapely.Polygon(BOX), *space.points(cells).T).reshape(space.shape)
    np.testing.assert_array_equal(space.beyond, ~within)
    assert not (space.evidence < 0)[space.beyond].any()
    assert (space.evidence < 0)[within].any()
    assert space.clearance()[space.beyond].max() == 0.0
    space.clear()
    assert (space.evidence[space.beyond] > 0).all()


def test_without_a_fence_nothing_is_beyond():
    space = seen(None, [[1.0, 1.0, 0.0]])
    assert not space.beyond.any()
    assert space.is_within(np.array([[1e6, 0.0]])).all()


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("fence") / "run"
    assert main(["explore", "rooms", "--fence", "0,0,6,5", "--errorless", "--out", str(folder)]) == 0
    return chainslam.load(folder)


@pytest.mark.usefixtures("_unchecked")
def test_a_mission_ends_at_the_fence(run):
    assert run.summary["status"] == "complete"
    ends = {end["why"]: end["position_m"] for end in run.summary["set_aside"]}
    edge = shapely.Polygon(BOX).exterior
    assert not shapely.contains_xy(shapely.Polygon(BOX), *ends.pop("beyond the fence"))
    assert all(edge.distance(shapely.Point(place)) < 0.5 for place in ends.values())
    assert run.summary["collisions"] == 0
    room = shapely.Polygon(BOX).buffer(0.01)
    assert shapely.contains_xy(room, run.steps["true_x_m"], run.steps["true_y_m"]).all()
    assert run.summary["coverage"] > 0.99
    assert run.summary["swept"] > 0.95


def test_only_rings_within_the_fence_are_to_be_closed():
    free = shapely.box(0, 0, 6, 4).difference(shapely.union_all([shapely.box(x, 1.5, x + 1, 2.5) for x in (1.5, 4)]))
    world = World("drawn", shapely.orient_polygons(free), np.array([0.7, 0.7, 0.0]), {})
    assert world.reachable_contour().contours == 3
    fenced = replace(world, fence=shapely.box(0, 0, 3.5, 4)).reachable_contour()
    assert fenced.contours == 1, "the pillar within; the outline goes on beyond, and so is the other pillar"
    assert fenced.length_m < world.reachable_contour().length_m


def test_a_fence_is_a_box_or_a_polygon_in_a_file(tmp_path):
    assert fence_of("0,0,6,5") == [list(corner) for corner in BOX]
    file = tmp_path / "fence.geojson"
    ring = [[0, 0], [4, 0], [2, 3], [0, 0]]
    file.write_text(json.dumps({"type": "Polygon", "coordinates": [ring]}))
    assert fence_of(str(file)) == ring[:-1]


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("0,0,6", "No such file"), ("0,0,6,x", "four different numbers"), ("0,0,0,5", "four different numbers"),
        ("0,0,nan,5", "four different numbers"), ("nowhere.geojson", "No such file"),
        ("50,50,60,60", "around the start"),
    ],
)  # fmt: skip
def test_what_is_no_fence_gets_one_line_and_status_2(text, words, tmp_path, capsys):
    assert main(["explore", "rooms", "--fence", text, "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert words in line


@pytest.mark.parametrize("content", ["", "[]", "{}", '{"type": "Point", "coordinates": [1, 2]}', "\x00"])
def test_a_file_without_a_polygon_gets_one_line(content, tmp_path, capsys):
    file = tmp_path / "fence.geojson"
    file.write_text(content)
    assert main(["explore", "rooms", "--fence", str(file), "--out", str(tmp_path / "out")]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "expected a fence" in line
