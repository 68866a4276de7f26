"""`replay` of a real robot's log: the same products as of a run of ours, and null where only the truth could tell."""

import json

import numpy as np
import pytest
import yaml
from PIL import Image
from rerun.chunk import RrdReader

from chainslam.experiments.artifacts.settings import parse_settings
from chainslam.experiments.commands.cli import main
from chainslam.experiments.replays import real_log
from chainslam.experiments.replays.real_log import RealOptions, read_real_run
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.scoring.maps.swept import SOON
from chainslam.slam.geometry.lines import directions, normals
from chainslam.viz.timeline.blueprints import comparison, one_run
from chainslam.viz.timeline.layers.sights import UNITS_PER_M
from chainslam.viz.timeline.words import legend

ROOM = (6.0, 4.0)
STRAIGHTNESS = "mission.mapper.walls.reliability.straightness"
MADE = {
    *("config.json", "summary.json", "log.npz", "map.npz", "map.geojson", "map.svg", "map.dxf", "map.png", "steps.csv"),
    *(
        "visibility.json",
        "visibility.png",
        "map.pgm",
        "map.yaml",
        "trajectory_estimated.tum",
        "trajectory_odometry.tum",
    ),
}


NO_BOUNDS = np.zeros((0, 2)), ((0.0, 1.0), (0.0, 1.0))


def names_of(part):
    """The names of all views of a layout."""
    inner = [
        name for each in getattr(part, "contents", None) or [] if not isinstance(each, str) for name in names_of(each)
    ]
    return [*([part.name] if part.name else []), *inner]


def seen_from(pose):
    """Ranges of 180 beams in an empty room whose lower left corner is the origin."""
    angles = pose[2] + np.deg2rad(np.arange(180) - 90.0)
    cosine, sine = np.cos(angles), np.sin(angles)
    with np.errstate(divide="ignore"):
        x = np.where(cosine > 0, (ROOM[0] - pose[0]) / cosine, -pose[0] / cosine)
        y = np.where(sine > 0, (ROOM[1] - pose[1]) / sine, -pose[1] / sine)
    return np.minimum(x, y)


def drive(scans=24, drift=0.0):
    """True poses and those of wheels that lose a little heading in every step."""
    true = np.array([[1.0 + 0.05 * k, 1.5, 0.02 * k] for k in range(scans)])
    return true, true + np.outer(np.arange(scans), [0.0, 0.0, drift])


def write_log(path, scans=24, drift=0.002, noise=0.005):
    rng = np.random.default_rng(3)
    lines = []
    for k, (true, wheels) in enumerate(zip(*drive(scans, drift), strict=True)):
        ranges = seen_from(true) + rng.normal(0.0, noise, 180)
        lines.append(" ".join(map(str, ["FLASER", 180, *ranges, *wheels, *wheels, 9e8 + 0.5 * k, "robot", 0.5 * k])))
    path.write_text("\n".join(lines) + "\n")
    return path


@pytest.fixture(scope="module")
def replayed(tmp_path_factory):
    folder = tmp_path_factory.mktemp("real")
    log = write_log(folder / "room.log")
    words = ["replay", str(log), "--backend", "full-ekf", "block-ekf", "--rrd", str(folder / "a.rrd")]
    assert main([*words, "--out", str(folder / "out")]) == 0
    return folder


def test_a_real_log_leaves_the_files_of_a_run_but_for_the_truth(replayed):
    for backend in ("full-ekf", "block-ekf"):
        assert {path.name for path in (replayed / "out" / backend).iterdir()} == MADE
    with np.load(replayed / "out" / "full-ekf" / "log.npz") as arrays:
        assert not [name for name in arrays.files if name.startswith("true")]


def test_the_paths_hold_all_scans_on_the_logs_own_clock_and_the_estimate_beats_the_wheels(replayed):
    true, _ = drive(drift=0.0)
    errors = {}
    for name in ("estimated", "odometry"):
        path = np.loadtxt(replayed / "out" / "full-ekf" / f"trajectory_{name}.tum")
        np.testing.assert_allclose(path[:, 0], 9e8 + 0.5 * np.arange(24))
        heading = 2 * np.arctan2(path[:, 6], path[:, 7])
        errors[name] = np.abs(heading - (true[:, 2] - true[0, 2]))[-1]
    assert errors["estimated"] < 0.3 * errors["odometry"]


def test_the_summary_has_every_key_of_a_run_and_null_for_what_only_the_truth_tells(replayed, tmp_path):
    assert main(["explore", "paper-fig4", "--max-steps", "3", "--out", str(tmp_path)]) == 0
    ours, theirs = (json.loads((f / "summary.json").read_text()) for f in (tmp_path, replayed / "out" / "full-ekf"))
    assert ours.keys() == theirs.keys()
    for key in ("pose_rmse_m", "pose_anees", "map_anees", "coverage", "swept", *SOON, "false_matches", "collisions"):
        assert theirs[key] is None
    assert theirs["status"] == "complete"
    assert theirs["lines"] >= 3
    assert theirs["duplicate_lines"] == 0
    assert theirs["step_ms"]["mean"] > 0


def test_the_timeline_has_the_wheels_path_beside_the_result_and_no_truth(replayed):
    paths = {str(path) for path in RrdReader(replayed / "a.rrd").store().schema().entity_paths()}
    assert "/world/odometry/path" in paths
    assert not [path for path in paths if path.startswith("/world/truth")]
    words = legend("room.log", plans=False, knows_truth=False)
    assert "truth" not in words
    assert "NEES" not in words
    assert "NEES" in legend("room.log", plans=False)
    for layout in (one_run("graph", *NO_BOUNDS, False), comparison(["graph"], *NO_BOUNDS, False)):
        assert not [name for name in names_of(layout) if "truth" in name or "NEES" in name]
        assert [name for name in names_of(layout) if "NIS" in name]
    rows = sum(
        chunk.num_rows for chunk in RrdReader(replayed / "a.rrd").stream().filter(content="/world/odometry/path")
    )
    steps = json.loads((replayed / "out" / "full-ekf" / "summary.json").read_text())["steps"]
    assert rows == steps + 1, "one row for each step, sent once for both back ends, and one for the style"


def bounds_of(rrd):
    """What each view of a recording shows by its name, along x and along y upwards."""
    reader, names, bounds = RrdReader(rrd), {}, {}
    (layout,) = reader.blueprints()
    for chunk in reader.stream(store=layout):
        path, batch = str(chunk.entity_path).split("/"), chunk.to_record_batch()
        if "ViewBlueprint:display_name" in batch.schema.names:
            ((names[path[2]],),) = batch.column("ViewBlueprint:display_name").to_pylist()
        if "VisualBounds2D:range" in batch.schema.names:
            ((shown,),) = batch.column("VisualBounds2D:range").to_pylist()
            bounds[path[2]] = np.array([shown["x_range"], np.negative(shown["y_range"][::-1])])
    return {names[view]: shown for view, shown in bounds.items()}


def test_the_views_of_the_timeline_hold_the_walls_of_all_maps_where_no_plan_says_how_far_they_reach(replayed):
    ends, lines = [], []
    for backend in ("full-ekf", "block-ekf"):
        with np.load(replayed / "out" / backend / "map.npz") as arrays:
            (alpha, d), anchors, extents = arrays["lines"].T, arrays["anchors"], arrays["extents"]
        middles = anchors + d[:, None] * normals(alpha)
        ends.append((middles[:, None] + extents[..., None] * directions(alpha)[:, None]).reshape(-1, 2))
        lines.append(np.vecdot(middles, normals(alpha)))
    walls, r = np.concatenate(ends), np.append(np.concatenate(lines), 0.0)
    reach = np.stack([walls.min(axis=0), walls.max(axis=0)], axis=1)
    views, margin = bounds_of(replayed / "a.rrd"), np.array([-1.0, 1.0])
    assert len(views) == 6
    for name, shown in views.items():
        if "model space" in name:
            assert shown[1, 0] < r.min() < r.max() < shown[1, 1], "every line's r"
            assert np.ptp(shown[1]) < 1.5 * (np.ptp(r) + 1.0)
        elif "visibility graph" in name:
            np.testing.assert_allclose(shown / UNITS_PER_M, reach + margin, atol=1e-6)
        else:
            np.testing.assert_allclose(shown, reach + 0.6 * margin, atol=1e-6)


def test_the_ros_map_of_it_is_the_floor_that_its_scans_show(replayed):
    grey = np.asarray(Image.open(replayed / "out" / "full-ekf" / "map.pgm"))[::-1]
    told = yaml.safe_load((replayed / "out" / "full-ekf" / "map.yaml").read_text())
    assert told["image"] == "map.pgm"

    def at(x, y):
        """Grey at a place in the true room, whose corner the first pose knows."""
        column, row = np.floor((np.array([x - 1.0, y - 1.5]) - told["origin"][:2]) / told["resolution"]).astype(int)
        return grey[row, column]

    assert {at(x, y) for x in (2.0, 3.0, 4.0) for y in (0.6, 1.5, 3.0)} == {254}
    assert at(3.0, 4.15) == at(6.15, 2.0) == 205
    occupied = np.argwhere(grey == 0)[:, ::-1] * told["resolution"] + told["origin"][:2] + np.array([1.0, 1.5])
    off = np.abs(np.concatenate([occupied[:, [0]] - [0.0, ROOM[0]], occupied[:, [1]] - [0.0, ROOM[1]]], axis=1)).min(
        axis=1
    )
    assert off.max() < 0.1


def test_a_report_is_made_of_it(replayed, capsys):
    assert main(["report", str(replayed / "out")]) == 0
    page = (replayed / "out" / "report.html").read_text()
    assert "The log of a real robot" in page
    assert "chainslam replay room.log --backend block-ekf full-ekf --every 1 --odometry scans --out DIR" in page


def test_the_same_command_leaves_the_same_bytes_and_another_is_refused_in_its_folder(replayed, tmp_path, capsys):
    words = ["replay", str(replayed / "room.log"), "--backend", "full-ekf", "--out", str(tmp_path)]
    assert main(words) == 0
    for name in ("trajectory_estimated.tum", "map.npz", "log.npz"):
        assert (tmp_path / name).read_bytes() == (replayed / "out" / "full-ekf" / name).read_bytes()
    assert main(words) == 0
    capsys.readouterr()
    assert main([*words, "--every", "2"]) == 2
    assert "a replay of other options" in capsys.readouterr().err


def test_walls_of_a_real_log_bow_and_whoever_knows_better_says_so(tmp_path):
    log, options = write_log(tmp_path / "room.log", scans=2), RealOptions()
    for sets, bow_rad in (((), np.deg2rad(0.5)), ((f"{STRAIGHTNESS}.bow_rad=0.0",), 0.0)):
        trial = read_real_run(log, options, None, parse_settings(sets), {}).trial
        straightness = trial.mission.mapper.walls.reliability.straightness
        assert straightness.bow_rad == pytest.approx(bow_rad)
        assert straightness.bow_m == 0.02
    assert TrialConfig("a").mission.mapper.walls.reliability.straightness.bow_m == 0.0


def test_settings_reach_the_mapper_and_every_second_keyframe_is_mapped(replayed, tmp_path):
    words = ["replay", str(replayed / "room.log"), "--out", str(tmp_path), "--every", "2", "--range-noise", "0.01"]
    assert main([*words, "--set", "mission.mapper.matching.gate=0.95"]) == 0
    config, summary = (json.loads((tmp_path / name).read_text()) for name in ("config.json", "summary.json"))
    assert config["trial"]["mission"]["mapper"]["matching"]["gate"] == 0.95
    assert config["replay"] == {
        "recorded": {"every": 2, "odometry": "scans", "second_looks": False, "range_noise": 0.01}
    }
    with np.load(tmp_path / "log.npz") as arrays:
        assert np.all(arrays["sigma_m"] == 0.01)
    whole = json.loads((replayed / "out" / "full-ekf" / "summary.json").read_text())["steps"]
    assert summary["steps"] == -(-whole // 2)
    assert len(np.loadtxt(tmp_path / "trajectory_estimated.tum")) == 24


def test_what_is_good_of_a_damaged_log_is_mapped_and_one_line_tells_where_it_ends(tmp_path, capsys):
    log = write_log(tmp_path / "room.log")
    content = log.read_text()
    log.write_text(content[: len(content) * 2 // 3])
    assert main(["replay", str(log), "--out", str(tmp_path / "out")]) == 0
    said = capsys.readouterr().err.splitlines()
    assert len(said) == 1
    assert said[0].startswith("chainslam: room.log: line 17: ")
    assert said[0].endswith("16 scans before it are used")
    assert len(np.loadtxt(tmp_path / "out" / "trajectory_estimated.tum")) == 16
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert summary["status"] == "stopped"
    assert summary["reason"].startswith("the recording ends early (line 17: ")


BAD = {
    "no log": ([], b"hello\n", "expected a recorded log, found room.log: expected lines FLASER"),
    "empty": ([], b"", "found none of them"),
    "truth": (["--association", "true"], None, "expected a log with the truth"),
    "every": (["--every", "0"], None, "--every of 1 or more keyframes, found 0"),
    "noise": (["--range-noise", "0"], None, "found --range-noise 0"),
    "settled": (["--set", "seed=4"], None, "'seed'"),
    "back end": (["--backend", "none"], None, "expected a back end from"),
}


@pytest.mark.parametrize("case", BAD)
def test_what_cannot_be_replayed_is_told_in_one_line(tmp_path, capsys, case):
    options, content, found = BAD[case]
    log = write_log(tmp_path / "room.log", 3)
    if content is not None:
        log.write_bytes(content)
    assert main(["replay", str(log), *options, "--out", str(tmp_path / "out")]) == 2
    said = capsys.readouterr().err.strip()
    assert found in said
    assert "\n" not in said
    assert not (tmp_path / "out" / "summary.json").exists()


@pytest.mark.parametrize("option", [["--every", "2"], ["--range-noise", "0.01"]])
def test_every_and_noise_are_refused_for_a_runs_own_log(replayed, capsys, option):
    assert main(["replay", str(replayed / "out" / "full-ekf" / "log.npz"), *option]) == 2
    assert "leave it out" in capsys.readouterr().err


@pytest.mark.parametrize("stop", ["SIGTERM", ""])
def test_an_interrupt_in_second_looks_ends_them_and_keeps_the_map(stop, tmp_path, monkeypatch, capsys):
    def interrupted(result, goes_on):
        raise KeyboardInterrupt(stop) if stop else KeyboardInterrupt

    monkeypatch.setattr(real_log, "looked_again", interrupted)
    log = write_log(tmp_path / "room.log")
    words = ["replay", str(log), "--backend", "full-ekf", "--second-looks", "--out", str(tmp_path / "out")]
    assert main(words) == 130
    summary = json.loads((tmp_path / "out" / "summary.json").read_text())
    assert (summary["status"], summary["outcome"]) == ("stopped", "interrupted")
    assert summary["reason"] == f"interrupted by {stop or 'Ctrl-C'} during offline refinement"
    assert summary["lines"] >= 3
    assert (tmp_path / "out" / "map.npz").exists()
    assert "Traceback" not in capsys.readouterr().err
