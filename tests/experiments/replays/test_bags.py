"""`replay` of bags to their end: what is assumed is told, and what was mapped can be mapped again."""

import json

import numpy as np
import pytest

from chainslam.experiments.commands.cli import main
from chainslam.slam.geometry.poses import compose, inverse
from tests.sim.logs.written_bag import PLACE, pose_at, room_bag


def replayed(path, out, *options):
    assert main(["replay", str(path), "--out", str(out), *options]) == 0
    return json.loads((out / "summary.json").read_text())


def off_at_the_end_m(out, place=PLACE):
    paths = np.loadtxt(out / "trajectory_estimated.tum")
    first, last = (compose(pose_at(row[0] - 1.0), place) for row in (paths[0], paths[-1]))
    return float(np.hypot(*(compose(inverse(first), last)[:2] - paths[-1, 1:3])))


def test_scans_of_uneven_beams_are_mapped_kept_and_mapped_again(tmp_path):
    bag = room_bag(tmp_path / "bag", count=lambda k: 178 + k % 5, noise_m=0.01)
    summary = replayed(bag, tmp_path / "out")
    assert summary["steps"] > 10
    assert off_at_the_end_m(tmp_path / "out") < 0.03
    with np.load(tmp_path / "out" / "log.npz") as log:
        assert set(log["fans"][:, 0]) == {178.0, 179.0, 180.0, 181.0, 182.0}
        assert log["ranges_m"].shape[1] == 182
    again = replayed(tmp_path / "out" / "log.npz", tmp_path / "again", "--odometry", "scans")
    assert (again["steps"], again["lines"]) == (summary["steps"], summary["lines"])


def test_scans_alone_are_mapped_and_it_is_told(tmp_path, capsys):
    bag = room_bag(tmp_path / "bag", odometry=False, mounting="none", noise_m=0.01)
    replayed(bag, tmp_path / "out")
    assert off_at_the_end_m(tmp_path / "out") < 0.03
    assert "bag: expected odometry, or a tf from an odom frame, found none" in " ".join(capsys.readouterr().err.split())


@pytest.mark.parametrize("option", ["--scan-topic", "--odom-topic"])
def test_topics_are_named_of_bags_only(tmp_path, capsys, option):
    log = tmp_path / "a.log"
    log.write_text("")
    assert main(["replay", str(log), option, "/scan"]) == 2
    assert "expected a ROS bag to name topics of" in capsys.readouterr().err
    bag = room_bag(tmp_path / "bag", count=lambda k: 30)
    assert main(["replay", str(bag), option, "/nowhere"]) == 2
    assert "expected a topic /nowhere of" in capsys.readouterr().err
