"""The report of a run: one page with its map, its numbers and whether it knows how wrong it is."""

import json
import re
import shlex
from dataclasses import replace

import pytest

from chainslam.experiments.artifacts.files import json_bytes
from chainslam.experiments.artifacts.results import config_record
from chainslam.experiments.artifacts.saved import read_trial
from chainslam.experiments.commands.cli import _parse, main
from chainslam.experiments.views.numbers import number, percent
from chainslam.experiments.views.run_page import run_page
from chainslam.sim.logs.recorded_robot import FORMAT


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert main(["explore", "paper-fig4", "--max-steps", "40", "--out", str(folder)]) == 0
    return folder


def test_a_run_is_told_on_one_page_that_fetches_nothing(run):
    assert main(["report", str(run), "--latex"]) == 0
    page, summary = (run / "report.html").read_text(), json.loads((run / "summary.json").read_text())
    assert not re.findall(r'(?:src|href)="(?!data:)', page)
    assert page.count("<img") == 7
    first = [page.index(part) for part in ('class="answer"', "<svg", "<img", 'data-name="map ANEES"', "<details>")]
    assert first == sorted(first)
    lead = re.search('class="answer">(.*?)</p>', page).group(1)
    assert lead.startswith("graph: stopped after")
    assert f"{percent(summary['coverage'])} %" in lead
    cells = dict(re.findall('data-name="(.*?)"[^>]*><span>(.*?)</span>', page))
    assert cells["map ANEES"] == number(summary["map_anees"])
    assert cells["pose error, cm"] == number(100.0 * summary["pose_rmse_m"])
    graph = json.loads((run / "visibility.json").read_text())["graph"]
    assert f"graph: {len(graph['nodes'])} walls, " in page
    assert "chainslam explore paper-fig4 --backend graph --strategy nearest-robot --seed 1" in page
    assert "pose ANEES" in (run / "tables.tex").read_text()


def test_back_ends_stand_side_by_side(run, tmp_path):
    out = tmp_path / "replay"
    assert main(["replay", str(run / "log.npz"), "--backend", "block-ekf", "full-ekf", "--out", str(out)]) == 0
    assert main(["report", str(out)]) == 0
    page = (out / "report.html").read_text()
    lead = re.search('class="answer">(.*?)</p>', page).group(1)
    summaries = {name: json.loads((out / name / "summary.json").read_text()) for name in ("block-ekf", "full-ekf")}
    for name, summary in summaries.items():
        assert f"{name} {number(summary['pose_anees_from_start'])}" in lead
    assert page.count("<img") == 9
    assert page.index("<img") < page.index("The maps side by side")
    assert 'data-name="block-ekf"' in page


def test_a_run_without_a_step_and_a_lost_file_are_told_in_words(run, tmp_path, capsys):
    summary = {
        "format": FORMAT,
        "status": "failed",
        "reason": "no wall",
        "steps": 0,
        "open_ends": None,
    }
    for name in ("config.json", "summary.json"):
        text = (run / name).read_text() if name == "config.json" else json.dumps(summary)
        (tmp_path / name).write_text(text)
    assert main(["report", str(tmp_path)]) == 0
    page = (tmp_path / "report.html").read_text()
    assert "failed before the first step: no wall" in page
    assert "ANEES" not in page
    (tmp_path / "summary.json").write_text("{")
    assert main(["report", str(tmp_path)]) == 2
    assert "summary.json" in capsys.readouterr().err


@pytest.mark.parametrize(
    "more",
    [
        "--strategy adaptive --seed 7 --p0 large --start 1.5 2.25 -0.1 --return-to-start --max-path 7.5",
        "--errorless --no-sweep --scale 0.05 --max-steps 9 --time-limit 60.5",
    ],
)
def test_the_command_on_the_page_makes_the_very_run(tmp_path, more):
    trial = _parse(["explore", "my hall.svg", *more.split()])[0].trial
    (tmp_path / "config.json").write_bytes(json_bytes(config_record(trial)))
    (tmp_path / "summary.json").write_text(json.dumps({"format": FORMAT, "status": "failed", "reason": "", "steps": 0}))
    assert _parse(shlex.split(run_page(tmp_path).command)[1:])[0].trial == trial


def test_a_replay_says_what_the_truth_took_the_place_of(run, tmp_path):
    log, out = str(run / "log.npz"), str(tmp_path)
    words = ["replay", log, "--association", "true", "--perfect-odometry", "--backend", "full-ekf", "--out", out]
    assert main(words) == 0
    page = run_page(tmp_path)
    assert page.told["true"] == ("matches", "odometry")
    said, given = _parse(shlex.split(page.command)[1:])[0], _parse(words)[0]
    assert replace(said, log=given.log, out=given.out) == given
    assert read_trial(tmp_path / "config.json").strategy == "none"
    (tmp_path / "config.json").write_text(
        json.dumps({**json.loads((tmp_path / "config.json").read_text()), "replay": 1})
    )
    assert main(["report", out]) == 2
