"""Before a run a world is told in two lines: what was understood, and who said where it starts and how large it is."""

import json
import re
from xml.etree import ElementTree

import numpy as np
import pytest
import shapely
from PIL import Image

from chainslam.experiments.artifacts.files import json_bytes
from chainslam.experiments.commands.cli import main
from chainslam.experiments.library.echo import campaign_line, expected_steps, run_line, world_lines
from chainslam.experiments.scenario import TrialConfig, load_world
from chainslam.experiments.terminal.console import say
from chainslam.experiments.trial import run_trial
from chainslam.sim.worlds import DrawingOptions, load

BOX = [[0, 0, 8, 0], [8, 0, 8, 6], [8, 6, 0, 6], [0, 6, 0, 0]]
SVG = '<svg xmlns="http://www.w3.org/2000/svg" {}><rect width="{}" height="{}" fill="none" stroke="black"/></svg>'


def lines_of(path, **given) -> tuple[str, ...]:
    return world_lines(load(path, **given))


def test_a_plan_is_told_with_its_size_and_who_said_what(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({"walls": BOX, "start": [4, 3, 1.5708]}))
    size, start = lines_of(path)
    assert size == "world plan: 7.9 x 5.9 m, 46.6 m2 of floor, 4 walls; understood 4 lines as walls"
    assert start == "start (4.00, 3.00) m, 90 degrees, as the file says; scale in metres"
    assert "start (2.00, 2.00) m, 0 degrees, given" in lines_of(path, start=(2.0, 2.0))[1]


def test_a_heading_just_below_zero_is_no_minus_zero(tmp_path):
    path = tmp_path / "plan.json"
    path.write_text(json.dumps({"walls": BOX, "start": [4, 3, -0.001]}))
    assert lines_of(path)[1].startswith("start (4.00, 3.00) m, 0 degrees,")


def test_what_was_assumed_is_told_with_how_to_say_it(tmp_path):
    path = tmp_path / "plan.png"
    grey = np.full((100, 100), 255, dtype=np.uint8)
    grey[0:2] = grey[-2:] = grey[:, 0:2] = grey[:, -2:] = 0
    Image.fromarray(grey).save(path)
    _, told = lines_of(path)
    assert "0.05 m a pixel, assumed (--scale METRES says another)" in told
    assert "assumed, where a robot has most room (--start X Y says another)" in told
    assert "0.1 m a pixel, given" in lines_of(path, options=DrawingOptions(scale=0.1))[1]


@pytest.mark.parametrize(
    ("head", "size", "words"),
    [
        ("", 8, "1 m a unit, assumed (--scale METRES says another)"),
        ('data-metres-per-unit="0.5"', 16, "0.5 m a unit, as the file says"),
        ('viewBox="0 0 800 800" width="800cm"', 800, "0.01 m a unit, by the size of the page"),
    ],
    ids=["assumed", "said", "page"],
)
def test_the_scale_of_a_drawing_is_told(tmp_path, head, size, words):
    path = tmp_path / "plan.svg"
    path.write_text(SVG.format(head, size, size))
    size_line, told = lines_of(path)
    assert words in told
    assert "understood 1 line as a wall" in size_line


def test_explore_and_compare_tell_each_world_once(tmp_path, capsys):
    plan = tmp_path / "plan $\\alpha{$.json"
    plan.write_text(
        json.dumps({"walls": BOX, "start": [4, 3], "labels": {"$\\alpha{$\ud800": [0, 0], "\x1b[1m": [8, 0]}})
    )
    out = tmp_path / "out\x1b[31m"
    assert main(["explore", str(plan), "--out", str(out), "--max-steps", "3"]) == 0
    said = capsys.readouterr()
    assert said.out.count("46.6 m2 of floor") == 1
    assert "\x1b" not in said.out + said.err
    assert not said.err
    assert json.loads((out / "config.json").read_text())["trial"]["world"] == str(plan)
    assert json.loads((out / "summary.json").read_text())["world"] == "plan $\\alpha{$"
    assert (out / "map.png").stat().st_size > 10_000
    assert "$\\alpha{$" in str(ElementTree.parse(out / "map.svg").getroot()[0].text)
    assert main(["report", str(out)]) == 0
    words = ["compare", "--worlds", "rooms", "--backends", "full-ekf", "--strategies", "nearest-robot", "--trials", "1"]
    assert main([*words, "--max-steps", "2", "--modes", "closed", "--jobs", "1", "--out", str(tmp_path / "c")]) == 0
    assert capsys.readouterr().out.count("world rooms: ") == 1


def test_a_refused_world_is_told_without_steering_the_terminal(tmp_path, capsys):
    assert main(["explore", str(tmp_path / "\x1b[2J\udc80.json")]) == 2
    said = capsys.readouterr()
    assert "\x1b" not in said.err
    assert len(said.err.splitlines()) == 1


def test_a_line_is_said_without_what_steers_the_terminal(capsys):
    say("a\x1b[2J\udc80\nb")
    assert capsys.readouterr().out == "a\\x1b[2J\\udc80 b\n"


def test_text_that_is_no_utf8_loses_no_file():
    assert json.loads(json_bytes({"world": "a\udc80é"}))["world"] == "a\udc80é"


@pytest.mark.parametrize(("world", "steps"), [("paper-fig4", 165), ("paper-fig9", 364), ("rooms", 734), ("hall", 761)])
def test_what_a_run_is_expected_to_take_holds_for_stored_runs(world, steps):
    low, high = expected_steps(load(world), 100_000)
    assert low <= steps <= high
    assert high < 5 * low


@pytest.mark.parametrize(
    ("corners", "seeds"),
    [
        ([(0, 0), (12, 0), (12, 1.2), (0, 1.2)], 1),
        ([(0, 0), (25, 0), (25, 3), (0, 3)], 1),
        ([(0, 0), (10, 0), (10, 10), (8.5, 10), (8.5, 1.5), (0, 1.5)], 1),
        ([(0, 0), (10, 0), (10, 10), (0, 10)], 1),
        pytest.param([(0, 0), (60, 0), (60, 1.5), (0, 1.5)], 1, marks=pytest.mark.long),
        pytest.param([(0, 0), (20, 0), (20, 20), (0, 20)], 5, marks=pytest.mark.long),
    ],
)
def test_what_corridors_and_halls_take_is_expected_within_a_factor_of_three(corners, seeds, tmp_path):
    """In the median: in a hall of which it sees no wall for 12 m a robot in three searches four times as long."""
    solid = shapely.Polygon(corners)
    solid = solid.buffer(0.3, join_style="mitre").difference(solid)
    wall = {"type": "Feature", "properties": {"kind": "wall"}, "geometry": shapely.geometry.mapping(solid)}
    path = tmp_path / "corridor.geojson"
    path.write_text(json.dumps({"type": "FeatureCollection", "features": [wall]}))
    low, high = expected_steps(load_world(str(path)), 100_000)
    runs = (run_trial(TrialConfig(str(path), "invariant-ekf", seed=seed)) for seed in range(1, seeds + 1))
    steps = np.median([run.summary["steps"] for run in runs])
    assert low <= steps <= high
    assert steps / 3.0 < np.sqrt(low * high) < 3.0 * steps


def test_a_run_is_told_with_both_clocks_and_no_further_than_its_limit():
    rooms = load("rooms")
    told = run_line(rooms, TrialConfig(world="rooms"))
    assert re.fullmatch(
        r"expected, roughly: \d+ to [\d,]+ steps; driving time .* to \d+ min, computing time \d+ s to .*", told
    )
    assert "expected, roughly: 5 steps;" in run_line(rooms, TrialConfig(world="rooms", max_steps=5))
    assert told != run_line(rooms, TrialConfig(world="rooms", backend="graph"))


def test_a_campaign_is_told_with_its_trials_and_processes():
    runs = [(load("rooms"), "full-ekf")] * 4
    assert campaign_line(runs, 0, 100, 2).startswith("expected, roughly: 4 trials; computing time 1 s to 6 s on 2 proc")
    assert campaign_line(runs, 1, 100, None).endswith("computing time 2 s to 12 s summed over all workers")
