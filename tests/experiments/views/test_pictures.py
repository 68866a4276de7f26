import json
import shutil
import sys

import pytest

from chainslam.experiments.commands.cli import main
from chainslam.experiments.views.pictures import main as draw
from chainslam.experiments.views.pictures import read_pictured
from chainslam.experiments.views.saved_map import saved_map


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """A run that was stopped with open ends, and one that has closed a contour."""
    folder = tmp_path_factory.mktemp("pictured")
    for steps in ("6", "120"):
        out = str(folder / steps)
        assert main(["explore", "paper-fig4", "--errorless", "--max-steps", steps, "--out", out]) == 0
    closed = [json.loads((folder / steps / "summary.json").read_text())["contours_closed"] for steps in ("6", "120")]
    assert closed[0] == 0 < closed[1]
    return folder


@pytest.mark.parametrize("steps", ["6", "120"])
def test_the_map_drawn_from_files_is_the_picture_beside_them(runs, tmp_path, monkeypatch, steps):
    monkeypatch.setattr(sys, "argv", ["pictures", str(runs / steps), "--out", str(tmp_path), "--kinds", "png", "pdf"])
    assert draw() == 0
    for name in ("map.png", "visibility.png"):
        assert (tmp_path / name).read_bytes() == (runs / steps / name).read_bytes()
    names = {"map", "visibility", "paths", "nees", "model", "traversals"}
    assert {path.name for path in tmp_path.iterdir()} == {f"{name}.{kind}" for name in names for kind in ("png", "pdf")}


def test_a_folder_without_a_map_is_one_line(runs, tmp_path, monkeypatch, capsys):
    home = shutil.copytree(runs / "6", tmp_path / "run")
    (home / "map.geojson").unlink()
    monkeypatch.setattr(sys, "argv", ["pictures", str(home), "--out", str(tmp_path / "out")])
    assert draw() == 2
    (said,) = capsys.readouterr().err.splitlines()
    assert said.startswith(f"pictures: expected map.geojson as this version writes it in {home}, found none: ")


def test_the_title_says_replayed_and_holds_one_error_against_the_other_in_one_unit(tmp_path):
    run, replay = tmp_path / "run", tmp_path / "replay"
    assert main(["explore", "paper-fig4", "--backend", "full-ekf", "--max-steps", "6", "--out", str(run)]) == 0
    assert main(["replay", str(run / "log.npz"), "--out", str(replay)]) == 0
    for folder, how in ((run, "nearest-robot"), (replay, "replayed")):
        read, summary = read_pictured(folder), json.loads((folder / "summary.json").read_text())
        shown = saved_map(folder, read.trial, read.log, read.walls, read.estimated_world)
        assert shown.title == f"paper-fig4   full-ekf, {how}, seed 1"
        errors = 100 * summary["pose_rmse_m"], 100 * summary["odometry_rmse_m"]
        assert "pose error rms {:.1f} cm (odometry alone {:.0f} cm)".format(*errors) in shown.subtitle
