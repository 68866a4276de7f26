"""The files of a plan, and the commands that write them and list what is in them."""

import json

import numpy as np
import pytest
import shapely

from chainslam.experiments.artifacts.files import json_bytes, npz_bytes, stamp
from chainslam.experiments.commands.cli import main
from chainslam.sim.worlds import load
from chainslam.slam.geometry.lines import normals

from .buildings import edges, mapped, two_rooms


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    """What `plan` and `check` read of a run: the map of two rooms with a table in one of them."""
    folder, floor = tmp_path_factory.mktemp("run"), two_rooms(furniture=True)
    faces = mapped(floor)
    n = len(faces)
    zeros = np.zeros(n, dtype=bool)
    arrays = {
        "pose": faces.pose_world, "ids": faces.ids, "lines": faces.means, "anchors": faces.anchors,
        "lines_world": faces.lines_world, "extents": faces.extents, "sightings": np.full(n, 9), "tentative": zeros,
        "crooked": zeros, "cov": faces.cov + 1e-12 * np.eye(len(faces.cov)),
    }  # fmt: skip
    (folder / "map.npz").write_bytes(npz_bytes(stamp() | arrays))
    chains = [
        {"geometry": {"coordinates": [[*ring[:, 0].tolist(), ring[0, 0].tolist()]]},
         "properties": {"kind": "chain", "closed": True, "chain": k, "walls": list(faces.chains[k])}}
        for k, ring in enumerate(edges(floor))
    ]  # fmt: skip
    (folder / "map.geojson").write_bytes(json_bytes(stamp() | {"features": chains}))
    drawn = {
        "type": "Feature",
        "properties": {},
        "geometry": json.loads(shapely.to_geojson(shapely.box(-0.2, -0.2, 7.3, 3.2).difference(two_rooms()))),
    }
    (folder / "drawing.geojson").write_text(json.dumps({"type": "FeatureCollection", "features": [drawn]}))
    return folder


def test_a_plan_is_written_in_every_format(folder, tmp_path, capsys):
    names = [tmp_path / f"plan.{kind}" for kind in ("svg", "pdf", "png", "dxf", "geojson")]
    assert main(["plan", str(folder), *(word for name in names for word in ("--out", str(name)))]) == 0
    assert "2 rooms" in capsys.readouterr().out
    svg = names[0].read_text()
    assert '<g id="layer-furniture" class="layer" style="display:none">' in svg
    layers = {feature["properties"]["layer"] for feature in json.loads(names[4].read_text())["features"]}
    assert {"walls", "walls-solid", "rooms", "dimensions", "furniture"} <= layers
    assert main(["plan", str(folder), "--out", str(names[0]), "--show", "furniture"]) == 0
    assert '<g id="layer-furniture" class="layer">' in names[0].read_text()


def test_the_drawing_has_dimension_entities_and_is_a_world_again(folder, tmp_path):
    import ezdxf

    path = tmp_path / "plan.dxf"
    assert main(["plan", str(folder), "--out", str(path)]) == 0
    document = ezdxf.readfile(path)
    dimensions = document.modelspace().query("DIMENSION")
    assert len(dimensions) >= 4
    assert all("±" in each.dxf.text for each in dimensions)
    assert not document.audit().errors
    assert document.layers.get("FURNITURE").is_off()
    before = path.read_bytes()
    assert main(["plan", str(folder), "--out", str(path)]) == 0
    assert path.read_bytes() == before
    assert load(str(path), (1.0, 1.0)).free.area == pytest.approx(21.0, rel=0.1)


def test_another_ending_and_a_folder_without_a_map_are_refused_in_one_line(folder, tmp_path, capsys):
    assert main(["plan", str(folder), "--out", str(tmp_path / "plan.dwg")]) == 2
    assert main(["plan", str(tmp_path)]) == 2
    assert main(["check", str(folder), str(tmp_path / "none.dxf")]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 3
    assert all(line.startswith("chainslam: expected") for line in said)


def test_measure_tells_dimensions_as_data(folder, capsys):
    assert main(["measure", str(folder), "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    areas = [each for each in told["dimensions"] if each["kind"] == "area"]
    assert [round(each["value_m2"], 6) for each in areas] == [12.0, 9.0]
    assert all(low < each["value_m2"] < high for each in areas for low, high in [each["interval_m2"]])
    assert told["main_direction"]["value_deg"] == pytest.approx(0.0, abs=1e-9)


def test_sure_relations_are_told_as_data_and_imposed_where_asked(folder, tmp_path, capsys):
    assert main(["measure", str(folder), "--structure", "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    assert {each["relation"] for each in told["structure"]["hypotheses"] if each["used"]} >= {"parallel", "right angle"}
    assert all(each["probability"] >= 0.99 for each in told["structure"]["hypotheses"] if each["used"])
    assert main(["measure", str(folder), "--json"]) == 0
    plain = json.loads(capsys.readouterr().out)
    sigmas = [[each["sigma_m"] for each in all_["dimensions"] if each["kind"] == "length"] for all_ in (told, plain)]
    assert np.median(np.divide(*sigmas)) < 1.0
    path = tmp_path / "plan.geojson"
    assert main(["plan", str(folder), "--structure", "--out", str(path)]) == 0
    assert "with structure" in json.loads(path.read_text())["name"]
    assert main(["measure", str(folder), "--structure"]) == 0
    assert "right angle" in capsys.readouterr().out


def test_a_tolerance_alone_or_too_large_and_corners_with_structure_are_refused(folder, capsys):
    for words in (["--tolerance-deg", "0.1"], ["--structure", "--tolerance-deg", "2"]):
        assert main(["plan", str(folder), *words]) == 2
        assert main(["measure", str(folder), *words]) == 2
    assert main(["measure", str(folder), "0", "1", "--structure"]) == 2
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 5
    assert all(line.startswith("chainslam: expected") for line in said)


def test_a_map_is_checked_against_a_drawing_file(folder, tmp_path, capsys):
    picture = tmp_path / "check.svg"
    words = ["check", str(folder), str(folder / "drawing.geojson"), "--start", "0.5", "0.5", "--at", "0", "0", "0"]
    assert main([*words, "--out", str(picture)]) == 0
    said = capsys.readouterr().out
    assert "0 moved, 0 missing, 0 not seen, 4 extra" in said
    assert picture.stat().st_size > 1000
    assert main([*words, "--json"]) == 0
    told = json.loads(capsys.readouterr().out)
    inner = [wall for wall in told["walls"] if wall["verdict"] == "within"]
    assert all(abs(wall["shift_m"]) < 1e-3 for wall in inner)
    assert told["tests"] == len(inner)
    assert np.abs(normals(np.array(told["alignment"]["heading_rad"]))[1]) < 1e-3
