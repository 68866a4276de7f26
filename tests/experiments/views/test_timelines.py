import csv
import json
from types import SimpleNamespace

import numpy as np
import pytest
from rerun.chunk import RrdReader

from chainslam.experiments.commands.cli import main
from chainslam.experiments.replays.replay import ReplayOptions, read_run, replay
from chainslam.experiments.scenario import load_world
from chainslam.experiments.scoring.summary import TIMED
from chainslam.experiments.views.timelines import TimelineOutput, record_comparison
from chainslam.viz.timeline.colours import pale

WORLD, STEPS = "paper-fig4", 70
EXPLORE = ["explore", WORLD, "--backend", "full-ekf", "--max-steps", str(STEPS)]
TIMINGS = (*TIMED, "seconds")

pytestmark = pytest.mark.usefixtures("_strict_rerun")


@pytest.fixture(scope="module")
def runs(tmp_path_factory):
    """The same run twice, with a recording and without one."""
    folder = tmp_path_factory.mktemp("recorded")
    recorded = main([*EXPLORE, "--out", str(folder / "with"), "--rrd", str(folder / "new" / "run.rrd")])
    plain = main([*EXPLORE, "--out", str(folder / "without")])
    assert (recorded, plain) == (0, 0)
    return SimpleNamespace(
        recorded=folder / "with", plain=folder / "without", rrd=folder / "new" / "run.rrd", rows=steps(folder / "with")
    )


def steps(folder):
    with (folder / "steps.csv").open() as stream:
        return list(csv.DictReader(stream))


def column(rows, name):
    return np.array([float(row[name]) for row in rows])


def read(rrd, entity, component):
    """Return the steps and the values of one component of one entity, static rows aside."""
    times, values = [], []
    for chunk in RrdReader(rrd).stream().filter(content=entity):
        batch = chunk.to_record_batch()
        if component in batch.schema.names and "step" in batch.schema.names:
            times += batch.column("step").to_pylist()
            values += batch.column(component).to_pylist()
    order = np.argsort(times, kind="stable")
    return np.array(times)[order], [values[k] for k in order]


def scalars(rrd, entity):
    times, values = read(rrd, entity, "Scalars:scalars")
    return times, np.array(values, dtype=float)[:, 0]


def without_timings(folder):
    """The bytes of every file of a run, without what a clock or an editor has a part in."""
    summary = json.loads((folder / "summary.json").read_text())
    rows = [{k: v for k, v in row.items() if k not in TIMINGS} for row in steps(folder)]
    config = {k: v for k, v in json.loads((folder / "config.json").read_text()).items() if k != "commit"}
    apart = ("summary.json", "steps.csv", "config.json")
    others = {p.name: p.read_bytes() for p in folder.iterdir() if p.name not in apart}
    return {k: v for k, v in summary.items() if k not in TIMINGS}, rows, config, others


def test_results_are_the_same_bytes_with_and_without_a_recording(runs):
    assert without_timings(runs.recorded) == without_timings(runs.plain)


def test_every_thing_that_is_shown_has_its_entity(runs):
    paths = {str(path) for path in RrdReader(runs.rrd).store().schema().entity_paths()}
    world = "/world/full-ekf"
    assert {"/world/truth/walls", "/world/truth/path", "/world/truth/robot", "/legend", "/model/axes"} <= paths
    assert {
        f"{world}/{name}"
        for name in (
            *(
                "path",
                "ellipse",
                "robot",
                "robot/body",
                "robot/scan",
                "robot/segments",
                "robot/refused",
                "why_refused",
                "corners",
                "open_ends",
            ),
            *("goal", "goal/name", "to_follow", "swept", "visibility/sights", "visibility/neighbours", "walls/0"),
        )
    } <= paths
    assert {"/model/full-ekf/walls/0", "/model/full-ekf/seen", "/model/full-ekf/matches"} <= paths
    assert {"/graph/full-ekf", "/decisions/full-ekf", "/plots/nees/full-ekf", "/plots/nees/band/high"} <= paths


@pytest.mark.parametrize(
    ("curve", "name"),
    [
        *(("nees", "pose_nees"), ("pose_trace", "pose_trace"), ("path_length_m", "path_length_m")),
        *(("open_ends", "open_ends"), ("lines", "lines"), ("closed_chains", "closed_chains"), ("step_ms", "step_ms")),
    ],
)
def test_curves_are_those_of_the_run(runs, curve, name):
    times, values = scalars(runs.rrd, f"/plots/{curve}/full-ekf")
    np.testing.assert_array_equal(times, np.arange(STEPS))
    np.testing.assert_allclose(values, column(runs.rows, name), rtol=1e-9)


def test_the_number_of_chains_and_the_circles_at_their_ends_are_those_of_the_map(runs):
    chains = json.loads((runs.recorded / "map.geojson").read_text())["features"]
    mapped = [feature for feature in chains if feature["properties"].get("kind") == "chain"]
    _, counts = scalars(runs.rrd, "/plots/chains/full-ekf")
    assert counts[-1] == len(mapped) > 0
    _, circles = read(runs.rrd, "/world/full-ekf/open_ends", "Ellipses2D:centers")
    assert len(circles[-1]) == int(runs.rows[-1]["open_ends"]) > 0


def test_the_robot_stands_where_the_run_says_and_y_points_up(runs):
    _, shifts = read(runs.rrd, "/world/full-ekf/robot", "Transform3D:translation")
    _, turns = read(runs.rrd, "/world/full-ekf/robot", "Transform3D:quaternion")
    places = np.array(shifts)[:, 0, :2]
    np.testing.assert_allclose(places, np.column_stack([column(runs.rows, f"{axis}_m") for axis in "xy"]), atol=1e-5)
    half = np.array(turns)[:, 0]
    heading = 2.0 * np.arctan2(half[:, 2], half[:, 3])
    off = np.angle(np.exp(1j * (heading - column(runs.rows, "heading_rad"))))
    np.testing.assert_allclose(off, 0.0, atol=1e-5)
    (frame,) = [c.to_record_batch() for c in RrdReader(runs.rrd).stream().filter(content="/world") if "scale" in str(c)]
    assert frame.column("Transform3D:scale").to_pylist()[-1][0] == [1.0, -1.0, 1.0]


def test_the_last_walls_drawn_are_those_of_the_map(runs):
    with np.load(runs.recorded / "map.npz") as arrays:
        ids, lines, anchors, extents = (arrays[name] for name in ("ids", "lines", "anchors", "extents"))
    for wall, (alpha, d), anchor, extent in zip(ids, lines, anchors, extents, strict=True):
        _, strips = read(runs.rrd, f"/world/full-ekf/walls/{wall}", "LineStrips2D:strips")
        n = np.array([np.cos(alpha), np.sin(alpha)])
        ends = anchor + d * n + extent[:, None] * np.array([-n[1], n[0]])
        np.testing.assert_allclose(strips[-1][0], ends, atol=0.01)


def test_ellipses_in_the_model_space_have_the_colour_of_their_walls_at_once(runs):
    paths = {str(path) for path in RrdReader(runs.rrd).store().schema().entity_paths()}
    changed = 0
    for path in (path for path in paths if path.startswith("/model/full-ekf/walls/")):
        times, ellipses = read(runs.rrd, path, "LineStrips2D:colors")
        for step, colour in zip(*read(runs.rrd, path.replace("model", "world"), "LineStrips2D:colors"), strict=True):
            shown = ellipses[np.searchsorted(times, step, side="right") - 1]
            assert shown == colour or shown == pale(np.array(colour, dtype=np.uint32)).tolist()
            changed += step > 0
    assert changed > 0


def test_refused_segments_say_why_and_the_goal_says_what_it_is(runs):
    steps, whys = read(runs.rrd, "/world/full-ekf/why_refused", "Points2D:labels")
    strips_at, strips = read(runs.rrd, "/world/full-ekf/robot/refused", "LineStrips2D:strips")
    np.testing.assert_array_equal(steps, strips_at)
    assert [len(why or ()) for why in whys] == [len(strip or ()) for strip in strips]
    assert all(word.startswith("refused: ") for why in whys for word in why or ())
    goals = dict(zip(*read(runs.rrd, "/world/full-ekf/goal/name", "Points2D:labels"), strict=True))
    log = zip(*read(runs.rrd, "/decisions/full-ekf", "TextLog:text"), strict=True)
    chosen = [(step, line) for step, (line,) in log if "goal: " in line]
    assert len(chosen) >= 3
    for step, line in chosen:
        (name,) = goals[step]
        assert line.startswith(f"{step:4d}  {name}: ")
        assert line.endswith(" m to drive")


def test_several_back_ends_stand_in_one_recording_on_one_time_axis(runs, tmp_path):
    run = read_run(runs.recorded / "log.npz")
    world, backends = load_world(run.trial.world), ["block-ekf", "full-ekf", "graph"]
    recording = TimelineOutput("three", backends, world, False, tmp_path / "three.rrd")
    finals = {}
    for backend in backends:
        watch = recording.watch(backend, lambda step: run.true_poses_world[step.index])
        finals[backend] = replay(run, backend, watch=watch)
    assert recording.close() == []
    plain = replay(run, "graph")
    np.testing.assert_array_equal(finals["graph"].log.estimated_world, plain.log.estimated_world)
    np.testing.assert_array_equal(finals["graph"].log.estimated_cov, plain.log.estimated_cov)
    for backend in backends:
        times, values = scalars(tmp_path / "three.rrd", f"/plots/nees/{backend}")
        np.testing.assert_array_equal(times, np.arange(STEPS))
        assert np.mean(values) / 3 == pytest.approx(finals[backend].summary["pose_anees"])
    times, _ = read(tmp_path / "three.rrd", "/world/truth/robot", "Transform3D:translation")
    np.testing.assert_array_equal(times, np.arange(STEPS))


def test_a_campaigns_summary_holds_its_tables(tmp_path):
    cell = {"world": "w", "strategy": "s", "mode": "replay", "association": "own"}
    trials = [
        {**cell, "backend": backend, "seed": seed, "status": "complete", "pose_anees": anees, "map_anees": None}
        for backend, anees in (("block-ekf", 100.0), ("full-ekf", 1.0))
        for seed in (1, 2)
    ]
    rows = [
        {**cell, "backend": "full-ekf", "step": k, "pose_anees": 10.0, "band_low": 0.1, "band_high": 1.0}
        | {"pose_error_rms_m": 0.25 * k}
        for k in range(3)
    ]
    target = tmp_path / "campaign.rrd"
    assert record_comparison(target, "campaign", trials, rows, None, (), ReplayOptions()) == []
    (dots,) = [
        batch.column("Points2D:positions").to_pylist()[0]
        for chunk in RrdReader(target).stream().filter(content="/campaign/0/dots/pose_anees/trials")
        if "Points2D:positions" in (batch := chunk.to_record_batch()).schema.names
    ]
    np.testing.assert_allclose(np.array(dots)[:, 1], [2.0, 2.0, 0.0, 0.0])
    np.testing.assert_allclose(scalars(target, "/campaign/0/curves/pose_anees/full-ekf")[1], 1.0)
    np.testing.assert_allclose(scalars(target, "/campaign/0/curves/pose_error_rms_m/full-ekf")[1], [0.0, 0.25, 0.5])
    (table,) = [
        chunk.to_record_batch().column("TextDocument:text").to_pylist()[0][0]
        for chunk in RrdReader(target).stream().filter(content="/campaign/table")
    ]
    assert "| w, s, replay, own | block-ekf | 2 | 2 | 100 |" in table
