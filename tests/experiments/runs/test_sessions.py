"""Maps that are used again: where a later session finds itself, and both sessions as one map."""

import json

import numpy as np
import pytest

from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.earlier import joined
from chainslam.sim.logs.recorded_robot import read_log, recording_of
from chainslam.slam.robot import Odometry

SQUARE = {
    "type": "FeatureCollection",
    "features": [
        {
            "type": "Feature",
            "properties": {"kind": "free"},
            "geometry": {"type": "Polygon", "coordinates": [[[0, 0], [5, 0], [5, 5], [0, 5], [0, 0]]]},
        }
    ],
}
pytestmark = pytest.mark.long
ELSEWHERE = ("rooms", "--seed", "2", "--start", "4.5", "1.5", "2.0")


def explore(out, *words):
    """Run `explore` and return its exit status and the summary it left."""
    status = main(["explore", *words, "--backend", "invariant-ekf", "--out", str(out)])
    return status, json.loads((out / "summary.json").read_text())


@pytest.fixture(scope="module")
def first(tmp_path_factory):
    """The results of a first session."""
    out = tmp_path_factory.mktemp("first") / "run"
    assert explore(out, "rooms", "--seed", "1", "--max-steps", "150")[0] == 0
    return out


@pytest.fixture(scope="module")
def second(first, tmp_path_factory):
    """The results of a second session that begins elsewhere."""
    out = tmp_path_factory.mktemp("second") / "run"
    assert explore(out, *ELSEWHERE, "--map", str(first), "--max-steps", "60")[0] == 0
    return out


def test_the_robot_finds_its_place_and_both_sessions_are_one_map(first, second):
    before, after = (json.loads((each / "summary.json").read_text()) for each in (first, second))
    said, log = after["session"], read_log(second / "log.npz")
    assert said["map"] == str(first)
    assert said["first_step"] == before["steps"]
    at = said["placed_at_step"]
    off = np.array(said["places_world"][0]) - log["true_poses"][at]
    assert np.hypot(*off[:2]) < 0.15
    assert abs(off[2]) < np.deg2rad(3.0)
    assert after["steps"] == len(log["time_s"]) == before["steps"] + 60
    assert before["steps"] < at < after["steps"]
    assert after["lines"] < 1.5 * before["lines"]
    assert after["duplicate_lines"] <= before["duplicate_lines"] + 1
    assert after["pose_rmse_m"] < 0.1
    assert 0.0 < said["pose_anees"] < 10.0


def test_on_the_way_between_two_sessions_the_robot_was_carried_and_that_is_no_path(second):
    log, after = read_log(second / "log.npz"), json.loads((second / "summary.json").read_text())
    begin = after["session"]["first_step"]
    assert np.flatnonzero(log["carried"]).tolist() == [begin]
    driven = np.hypot(*log["odometry"][:, :2].T)
    assert driven[begin] > 0.3  # twice the longest step
    assert after["path_length_m"] == pytest.approx(driven.sum() - driven[begin])
    assert after["path_length_true_m"] == pytest.approx(after["path_length_m"], rel=0.05)
    assert np.all(np.diff(log["time_s"]) >= 0.0)


def test_the_log_of_both_replays_through_other_back_ends(second, tmp_path):
    assert main(["replay", str(second / "log.npz"), "--backend", "full-ekf", "--out", str(tmp_path / "again")]) == 0
    again = json.loads((tmp_path / "again" / "summary.json").read_text())
    assert again["path_length_m"] == json.loads((second / "summary.json").read_text())["path_length_m"]
    assert again["pose_rmse_m"] < 0.1


def test_a_replayed_log_is_placed_in_a_saved_map(first, tmp_path, capsys):
    status, _ = explore(tmp_path / "own", *ELSEWHERE, "--max-steps", "40")
    assert status == 0
    said = ["replay", str(tmp_path / "own" / "log.npz"), "--map", str(first), "--backend", "full-ekf", "block-ekf"]
    assert main([*said, "--out", str(tmp_path / "both")]) == 0
    assert "both sessions are one map" in capsys.readouterr().out
    for name in ("full-ekf", "block-ekf"):
        both = json.loads((tmp_path / "both" / name / "summary.json").read_text())
        assert both["steps"] == both["session"]["first_step"] + 40
        assert both["pose_rmse_m"] < 0.1


def test_in_a_symmetric_building_two_places_are_named_and_the_session_keeps_a_map_of_its_own(tmp_path, capsys):
    (tmp_path / "square.geojson").write_text(json.dumps(SQUARE))
    world = str(tmp_path / "square.geojson")
    assert explore(tmp_path / "a", world, "--start", "1.0", "1.0", "--max-steps", "60")[0] == 0
    words = world, "--start", "3.0", "2.0", "1.0", "--max-steps", "60", "--map", str(tmp_path / "a")
    status, after = explore(tmp_path / "b", *words)
    assert status == 0
    assert after["session"]["first_step"] == 0
    assert len(after["session"]["places_world"]) == 2
    assert after["steps"] <= 60
    assert after["pose_rmse_m"] < 0.1
    assert "two places are possible" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "told"),
    [(["--map", "nowhere"], "log.npz"), (["--set", "robot.lidar.beams=90", "--map", "FIRST"], "the same scanner")],
)
def test_what_cannot_be_a_map_of_the_building_ends_in_one_line(first, tmp_path, capsys, words, told):
    words = [str(first) if word == "FIRST" else word for word in words]
    assert main(["explore", "rooms", "--out", str(tmp_path / "run"), *words]) == 2
    found = capsys.readouterr().err.strip().splitlines()
    assert len(found) == 1
    assert told in found[0]


def test_a_recording_of_two_sessions_leads_from_the_end_of_one_to_the_begin_of_the_other(first):
    recording = recording_of(read_log(first / "log.npz"))
    carried = Odometry(np.array([1.0, 2.0, 0.5]), np.diag([0.1, 0.1, 0.02]) ** 2)
    both, begin = joined(recording, recording, carried), len(recording)
    assert len(both) == 2 * begin
    np.testing.assert_array_equal(both.odometry[begin], carried.motion)
    np.testing.assert_array_equal(both.odometry_cov[begin], carried.cov)
    np.testing.assert_array_equal(both.ranges_m[begin:], recording.ranges_m)
    assert np.all(np.diff(both.time_s) >= 0.0)
    assert np.flatnonzero(joined(both, recording, carried).carried).tolist() == [begin, 2 * begin]
