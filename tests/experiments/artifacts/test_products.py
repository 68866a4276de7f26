"""The map as a product: each file is read by others, and by the readers of worlds here."""

import json
from dataclasses import replace
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
import yaml
from ezdxf import recover
from PIL import Image

from chainslam.experiments.artifacts.maps.mapped import read_corners
from chainslam.experiments.artifacts.maps.occupancy import occupancy_files
from chainslam.experiments.artifacts.results import _dimensions, write_results
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.trial import run_trial
from chainslam.explore.floor.free_space import FreeSpace
from chainslam.sim.worlds import load


@pytest.fixture(scope="module")
def explored(world, tmp_path_factory):
    import jaxtyping

    folder = tmp_path_factory.mktemp("explored")
    jaxtyping.config.update("jaxtyping_disable", True)
    result = run_trial(TrialConfig("square", errorless=True), world=world)
    assert write_results(result, folder) == []
    return result, folder


def _features(folder):
    return json.loads((folder / "map.geojson").read_text())["features"]


def test_the_certificate_is_in_the_summary(explored, world):
    _, folder = explored
    summary = json.loads((folder / "summary.json").read_text())
    certificate = summary["certificate"]
    assert (summary["status"], certificate["outcome"]) == ("complete", "all-closed")
    assert sorted(contour["contour"] for contour in certificate["contours"]) == ["island", "room"]
    assert all(shapely.Polygon(contour["polygon"]).is_valid for contour in certificate["contours"])
    assert certificate["floor_m2"] == pytest.approx(world.free.area, abs=0.05)
    assert certificate["open_ends"] == []


def test_geojson_holds_valid_shapes_and_says_that_it_is_in_metres(explored, world):
    _, folder = explored
    document = json.loads((folder / "map.geojson").read_text())
    assert document["crs"]["properties"]["name"].startswith("LOCAL_CS")
    ids = [feature["id"] for feature in document["features"]]
    assert len(set(ids)) == len(ids)
    assert {"wall-0", "corner-0", "chain-0", "trajectory", "start"} <= set(ids)
    assert "metres" in document["coordinate_system"]
    shapes = {}
    for feature in document["features"]:
        shape = shapely.from_geojson(json.dumps(feature["geometry"]))
        assert shape.is_valid
        shapes.setdefault(feature["properties"]["kind"], []).append((shape, feature["properties"]))
    assert {kind: len(found) for kind, found in shapes.items()} == {
        "chain": 2,
        "wall": 8,
        "corner": 8,
        "trajectory": 1,
        "start": 1,
    }
    assert all(shape.exterior.is_ccw for shape, _ in shapes["chain"])
    for kind, key in (("wall", "covariance_alpha_d"), ("corner", "covariance_xy_m2")):
        covs = np.array([properties[key] for _, properties in shapes[kind]])
        assert np.all(np.linalg.eigvalsh(covs) > 0)
    room = next(shape for shape, properties in shapes["chain"] if properties["contour"] == "room")
    assert room.hausdorff_distance(shapely.Polygon(world.free.exterior)) < 0.05


def test_the_floor_plan_tells_lengths_and_areas_as_measure_does(explored):
    _, folder = explored
    mapped = read_corners(folder)
    texts = [each for each in ElementTree.parse(folder / "map.svg").iter() if each.tag.endswith("}text")]
    told = [(each.text, each[0].text) for each in texts if len(each)]
    sides = [side for room in mapped.rooms for side in mapped.sides(room)]
    (room,) = [room for room in mapped.rooms if not room.is_island]
    assert len(told) == len(sides) + 1
    for (words, hint), (first, second, measured) in zip(told, sides, strict=False):
        low, high = measured.interval
        # A short side has no room for its interval, which its tooltip has.
        assert words in (f"{measured.value:.3f} ± {high - measured.value:.3f}", f"{measured.value:.3f}")
        assert hint.startswith(f"corner {first} to corner {second}: {measured.value:.3f} m")
        assert hint.endswith(f"95 % interval {low:.3f} to {high:.3f} m")
    low, high = mapped.area(room).interval
    assert told[-1][0] == f"{(low + high) / 2:.3f} ± {(high - low) / 2:.3f} m²"


def test_a_length_stands_on_the_free_side_of_its_wall_and_an_area_on_free_floor(explored, world):
    result, folder = explored
    for each in _dimensions(result, _features(folder)):
        left = np.array([-each.along_world[1], each.along_world[0]]) / np.hypot(*each.along_world)
        shift = np.zeros(2) if each.is_area else 0.1 * left
        assert world.free.contains(shapely.Point(each.at_world + shift))
        if not each.is_area:
            assert not world.free.contains(shapely.Point(each.at_world - shift))


def test_without_a_covariance_the_floor_plan_has_no_intervals(explored):
    result, folder = explored
    assert _dimensions(replace(result, joint=None), _features(folder)) == []


def test_the_drawing_holds_the_chains_of_the_geojson(explored):
    _, folder = explored
    drawing, found = recover.readfile(folder / "map.dxf")
    assert not found.has_errors
    drawn = [np.array(list(each.get_points("xy"))) for each in drawing.query('LWPOLYLINE[layer=="WALLS"]')]
    chains = [f["geometry"]["coordinates"][0] for f in _features(folder) if f["properties"]["kind"] == "chain"]
    assert len(drawn) == len(chains)
    for mine, theirs in zip(drawn, chains, strict=True):
        np.testing.assert_allclose(mine, theirs[:-1], atol=1e-9)


@pytest.mark.parametrize("name", ["map.yaml", "map.svg", "map.geojson"])
def test_a_map_is_a_world_again_and_explored_again(explored, world, name):
    _, folder = explored
    again = load(folder / name)
    assert len(again.free.interiors) == 1
    assert again.free.area == pytest.approx(world.free.area, rel=0.05)
    if name == "map.yaml":
        # The picture lies in the map's own frame; faces stand where the cells that were hit begin. Beams five
        # metres away lie two cells apart, so that a corner may be cut off between two of them.
        assert again.free.exterior.hausdorff_distance(world.free.exterior) < 0.15
        assert again.free.symmetric_difference(world.free).area < 0.05 * world.free.area
    else:
        assert len(again.faces) == 8
        np.testing.assert_allclose(again.start[2], world.start[2], atol=1e-4)
    summary = run_trial(TrialConfig(str(folder / name), errorless=True)).summary
    assert (summary["status"], summary["collisions"]) == ("complete", 0)
    assert summary["coverage"] > 0.99


def test_the_occupancy_map_is_what_the_robot_knows(explored):
    result, folder = explored
    free_space = result.last.free_space
    said = yaml.safe_load((folder / "map.yaml").read_text())
    grey = np.asarray(Image.open(folder / said["image"]))
    assert set(np.unique(grey).tolist()) == {0, 205, 254}
    rng = np.random.default_rng(4)
    points = rng.uniform(0.0, 5.0, (400, 2))
    cells = tuple(free_space.cells(points).T)
    column, up = np.floor((points - said["origin"][:2]) / said["resolution"]).astype(int).T
    assert grey[len(grey) - 1 - up, column].tolist() == [
        254 if value < 0 else 0 if value > 0 else 205 for value in free_space.evidence[cells]
    ]


def test_nothing_seen_is_no_map():
    with pytest.raises(ValueError, match="expected floor seen"):
        occupancy_files(FreeSpace(), np.zeros(3))


def test_an_unfinished_map_shows_its_open_ends(world, tmp_path):
    result = run_trial(TrialConfig("square", errorless=True, max_steps=3), world=world)
    assert write_results(result, tmp_path) == []
    ends = result.summary["certificate"]["open_ends"]
    assert ends
    plan = ElementTree.parse(tmp_path / "map.svg").getroot()
    titles = [title.text for title in plan.iter("{http://www.w3.org/2000/svg}title")]
    assert sum("not explored yet" in title for title in titles) == len(ends)
    kinds = [
        feature["properties"]["kind"] for feature in json.loads((tmp_path / "map.geojson").read_text())["features"]
    ]
    assert kinds.count("open-end") == len(ends)
    assert kinds.count("unseen") == len(result.summary["certificate"]["unseen_borders"]) > 0
