"""The log of a real robot in a building that is mapped already: placed in the saved map, and mapped on with it."""

import json
import shutil
from itertools import pairwise

import numpy as np
import pytest

from chainslam.experiments.commands.cli import main
from chainslam.sim.lidar import LidarConfig, RangeFinder
from chainslam.slam.association.second_looks.placement import FINE
from chainslam.slam.geometry.poses import compose, inverse, wrap
from tests.slam.extraction.test_extract import loop

CROOKED = loop((0, 0), (6, 0), (6, 2), (4.5, 2), (4.5, 4.2), (2, 4.2), (2, 3), (0, 3))
LONG = loop((0, 0), (6, 0), (6, 4), (0, 4))
OTHER = loop((0, 0), (9, 0), (9, 1.7), (5, 1.7), (5, 7), (3.2, 7), (3.2, 1.7), (0, 1.7))
pytestmark = pytest.mark.long


def turning(at, first_deg, last_deg):
    """Poses of a turn on the spot."""
    return [np.array([*at, np.deg2rad(each)]) for each in np.arange(first_deg, last_deg, 6.0)]


def drive(*ways):
    """Poses along straight ways, with a turn on the spot at each point."""
    found = []
    for (x, y), (to_x, to_y) in pairwise(ways):
        heading = np.arctan2(to_y - y, to_x - x)
        found += turning((x, y), np.rad2deg(heading) - 180.0, np.rad2deg(heading) + 180.0)
        found += [
            np.array([x + s * (to_x - x), y + s * (to_y - y), heading])
            for s in np.linspace(0.0, 1.0, int(np.hypot(to_x - x, to_y - y) / 0.12))
        ]
    return np.array(found)


def write_log(path, faces, true, seed):
    """Write what a scanner sees along a way, and what wheels that lose a little heading say, from the start."""
    config = LidarConfig(beams=180, fov_rad=float(np.deg2rad(179.0)), range_max_m=20.0)
    finder, rng, lines = RangeFinder(faces, config), np.random.default_rng(seed), []
    for k, pose in enumerate(true):
        ranges = finder.cast(pose)[0] + rng.normal(0.0, 0.005, 180)
        wheels = compose(inverse(true[0]), pose) + np.array([0.0, 0.0, 0.0005 * k])
        lines.append(" ".join(map(str, ["FLASER", 180, *ranges, *wheels, *wheels, 9e8 + 0.5 * k, "robot", 0.5 * k])))
    path.write_text("\n".join(lines) + "\n")
    return path


def replayed(log, out, *words):
    """Replay a log; return the exit status and its summary."""
    status = main(["replay", str(log), "--out", str(out), *map(str, words)])
    return status, json.loads((out / "summary.json").read_text())


FIRST = drive((1.0, 1.0), (5.0, 1.0), (3.2, 3.0))
SECOND = drive((3.3, 3.2), (3.5, 1.2), (1.2, 1.4))


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """The results of a first log."""
    folder = tmp_path_factory.mktemp("first")
    assert replayed(write_log(folder / "a.log", CROOKED, FIRST, 1), folder / "map")[0] == 0
    return folder / "map"


def test_a_log_that_begins_lost_is_placed_in_the_map_of_another_and_both_are_one(first, tmp_path, capsys):
    log = write_log(tmp_path / "b.log", CROOKED, SECOND, 2)
    status, summary = replayed(log, tmp_path / "both", "--map", first)
    assert status == 0
    said, before = summary["session"], json.loads((first / "summary.json").read_text())
    off = np.array(said["places_world"][0]) - compose(inverse(FIRST[0]), SECOND[0])
    off[2] = wrap(off[2])
    assert np.hypot(*off[:2]) < 0.05
    assert off @ np.linalg.solve(said["place_covs"][0], off) < 16.3  # 0.999 of chi-square
    assert said["first_step"] == said["placed_at_step"] == before["steps"]
    assert summary["steps"] > before["steps"] + 50
    assert summary["lines"] <= before["lines"] + 1
    with np.load(tmp_path / "both" / "map.npz") as both, np.load(first / "map.npz") as old:
        assert both["cov"].shape == 2 * (3 + 2 * summary["lines"],)
        true = compose(inverse(FIRST[0]), SECOND[-1])
        assert np.hypot(*(both["pose"] - true)[:2]) < 0.05
        longest = np.argmax(np.ptp(old["extents"], axis=1))
        nearest = np.abs(both["lines_world"] - old["lines_world"][longest]).sum(axis=1).min()
        assert nearest < 0.05
    told = capsys.readouterr().out
    assert "both sessions are one map" in told
    assert "the log begins at" in told
    with np.load(tmp_path / "both" / "log.npz") as log:
        assert np.flatnonzero(log["carried"]).tolist() == [before["steps"]]


def test_where_two_places_are_possible_both_are_named_and_the_log_keeps_a_map_of_its_own(tmp_path, capsys):
    way = drive((1.0, 1.0), (5.0, 1.0), (3.0, 3.0))
    assert replayed(write_log(tmp_path / "a.log", LONG, way, 1), tmp_path / "map")[0] == 0
    log = write_log(tmp_path / "b.log", LONG, drive((2.0, 3.0), (4.0, 1.2), (1.5, 1.2)), 2)
    status, summary = replayed(log, tmp_path / "b", "--map", tmp_path / "map")
    said = summary["session"]
    assert (status, said["first_step"], said["placed_at_step"], len(said["places_world"])) == (0, 0, None, 2)
    turn = wrap(said["places_world"][0][2] - said["places_world"][1][2])
    assert abs(turn) == pytest.approx(np.pi, abs=0.05)
    assert "two places are possible" in capsys.readouterr().out


def test_a_log_of_another_building_has_no_place(first, tmp_path, capsys):
    log = write_log(tmp_path / "b.log", OTHER, drive((1.0, 0.8), (4.1, 0.9), (4.1, 6.0)), 2)
    status, summary = replayed(log, tmp_path / "b", "--map", first)
    assert status == 0
    assert (summary["session"]["first_step"], summary["session"]["places_world"]) == (0, [])
    assert summary["second_looks"]["lines"] == summary["lines"]
    assert "was not found (nothing fits)" in capsys.readouterr().out


def test_a_map_of_another_scanner_ends_in_one_line(tmp_path, first, capsys):
    log = tmp_path / "b.log"
    ranges = " ".join(["2.0"] * 90)
    log.write_text("".join(f"FLASER 90 {ranges} {k}.0 0 0 {k}.0 0 0 {k}.0 robot {k}.0\n" for k in range(4)))
    capsys.readouterr()
    for words in (["--map", str(tmp_path / "nowhere")], ["--map", str(first)]):
        assert main(["replay", str(log), "--out", str(tmp_path / "out"), *words]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) <= 2


def changed(first, folder, file, **arrays):
    """A copy of a folder of results with other arrays in one of its files."""
    shutil.copytree(first, folder)
    with np.load(folder / file) as kept:
        np.savez(folder / file, **(dict(kept) | arrays))
    return folder


def test_the_carried_motion_is_as_sure_as_the_place_the_search_and_the_pose_before_together(first, tmp_path):
    """The first session keeps its frame, wherever that began."""
    start = np.array([1.0, -2.0, 0.4])
    moved = changed(first, tmp_path / "moved", "log.npz", start_pose=start)
    log = write_log(tmp_path / "b.log", CROOKED, SECOND, 2)
    status, summary = replayed(log, tmp_path / "both", "--map", moved)
    assert status == 0
    with np.load(tmp_path / "both" / "log.npz") as both, np.load(moved / "map.npz") as old:
        (at,) = np.flatnonzero(both["carried"])
        expected = FINE.cov + np.array(summary["session"]["place_covs"][0]) + old["cov"][:3, :3]
        np.testing.assert_allclose(both["odometry_cov"][at], expected, rtol=1e-6)
        np.testing.assert_allclose(
            both["odometry"][at], compose(inverse(old["pose"]), summary["session"]["places_world"][0])
        )
        np.testing.assert_allclose(both["start_pose"], start)


def test_walls_that_were_never_confirmed_place_no_log(first, tmp_path):
    with np.load(first / "map.npz") as kept:
        tentative = np.arange(len(kept["ids"])) > 0
    doubtful = changed(first, tmp_path / "doubtful", "map.npz", tentative=tentative)
    log = write_log(tmp_path / "b.log", CROOKED, SECOND, 2)
    assert replayed(log, tmp_path / "b", "--map", doubtful)[1]["session"]["places_world"] == []


def test_a_map_that_cannot_be_used_ends_in_one_line(first, tmp_path, capsys):
    log = write_log(tmp_path / "b.log", CROOKED, SECOND, 2)
    with np.load(first / "map.npz") as kept, np.load(first / "log.npz") as recorded:
        lost = np.full_like(kept["cov"], np.inf)
        nothing, narrow = np.ones(len(kept["ids"]), dtype=bool), 0.9 * recorded["bearings_rad"]
    for name, file, arrays, words in (
        ("lost", "map.npz", {"cov": lost}, "found an invalid covariance"),
        ("empty", "map.npz", {"tentative": nothing}, "expected a map with walls, found none"),
        ("narrow", "log.npz", {"bearings_rad": narrow}, "made with the same scanner"),
    ):
        folder = changed(first, tmp_path / name, file, **arrays)
        capsys.readouterr()
        assert main(["replay", str(log), "--out", str(tmp_path / "out"), "--map", str(folder)]) == 2
        (line,) = [each for each in capsys.readouterr().err.splitlines() if "expected" in each]
        assert words in line
