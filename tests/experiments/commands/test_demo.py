"""The demonstration: what it leaves, what it says of it, and when it opens a browser."""

import json
import sys
import webbrowser
from pathlib import Path
from types import SimpleNamespace

import pytest

from chainslam.experiments.commands import demo
from chainslam.experiments.commands.cli import main
from chainslam.experiments.commands.demo import ESTIMATORS, open_page, seen
from chainslam.experiments.library.runs import Run
from chainslam.experiments.views.run_lines import SCATTER
from chainslam.sim.logs.recorded_robot import FORMAT

RUN = {
    "world": "rooms", "contours_closed": 3, "contours_reachable": 4, "steps": 17, "path_length_m": 4.25,
    "outcome": "all-closed", "status": "complete", "reason": "every chain is closed", "pose_anees_from_start": 1.0,
}  # fmt: skip
SHOWN = ("DISPLAY", "WAYLAND_DISPLAY", "BROWSER")


@pytest.fixture(autouse=True)
def opened(monkeypatch):
    """The addresses that a browser was asked to show; none is started."""
    pages = []
    monkeypatch.setattr(webbrowser, "open", pages.append)
    return pages


@pytest.fixture
def done(monkeypatch):
    """What the demonstration asks for, in turn; `ends` says what else than RUN a run comes to, by its name."""
    done = SimpleNamespace(asked=[], ends={})

    def come_to(name, out, force):
        done.asked.append((name, out, force))
        out.mkdir(parents=True)
        (out / "summary.json").write_text(json.dumps({"format": FORMAT} | RUN | done.ends.get(name, {})))
        return Run(out)

    monkeypatch.setattr(demo, "explore", lambda world, *, seed, out, force, watch: come_to(world, out, force))
    monkeypatch.setattr(demo, "replay", lambda run, *, backend, out, force, watch: come_to(backend, out, force))
    monkeypatch.setattr(demo, "report_at", lambda folder: (None, folder / "report.html"))
    return done


def test_it_explores_replays_through_each_estimator_and_says_three_lines(done, opened, tmp_path, capsys):
    assert main(["demo", "--out", str(tmp_path)]) == 0
    said = capsys.readouterr()
    lines = said.out.splitlines()
    assert (len(lines), said.err, opened) == (3, "", [])
    assert str(tmp_path / "run" / "map.png") in lines[0]
    assert str(tmp_path / "replays" / "report.html") in lines[2]
    replays = [(name, tmp_path / "replays" / name, False) for name in ESTIMATORS]
    assert done.asked == [(demo.WORLD, tmp_path / "run", False), *replays]


def test_force_holds_for_every_run_and_json_is_all_there_is(done, tmp_path, capsys):
    assert main(["demo", "--force", "--json", "--out", str(tmp_path)]) == 0
    assert all(force for _, _, force in done.asked)
    told = json.loads(capsys.readouterr().out)
    assert set(told["replayed"]) == set(ESTIMATORS)
    assert told["report"] == str(tmp_path / "replays" / "report.html")


@pytest.mark.parametrize("which", [0, 2])
@pytest.mark.parametrize(("outcome", "status"), [("interrupted", 130), ("failed", 1)])
def test_a_run_that_does_not_come_to_its_end_is_the_last(which, outcome, status, done, tmp_path, capsys):
    name = (demo.WORLD, *ESTIMATORS)[which]
    done.ends[name] = {"outcome": outcome, "status": "stopped", "steps": 3, "reason": "by a hand"}
    assert main(["demo", "--out", str(tmp_path)]) == status
    said = capsys.readouterr()
    assert said.out == ""
    assert "by a hand" in said.err
    assert done.asked[-1][0] == name
    assert len(done.asked) == which + 1


def test_the_lines_name_the_estimator_that_is_overconfident_and_by_how_much():
    scores = {"block-ekf": {"pose_anees_from_start": 16.0}, "graph": {"pose_anees_from_start": 0.9364}}
    explored, replayed, verdict = seen(RUN, scores, Path("map.png"), Path("report.html"))
    assert "3 of 4" in explored
    assert "17 steps and 4.2 m" in explored
    assert "2 estimators" in replayed
    assert "block-ekf 16, graph 0.936" in replayed
    assert verdict.startswith("block-ekf is overconfident")
    assert "4.0 times" in verdict


def test_an_estimator_is_called_overconfident_beyond_the_scatter_of_single_runs():
    last = seen(RUN, {"graph": {"pose_anees_from_start": 3.1}}, Path("map.png"), Path("report.html"))[-1]
    assert last.startswith("graph is overconfident")


@pytest.mark.parametrize("score", [2.9, None])
def test_no_estimator_is_called_overconfident_where_none_is(score):
    last = seen(RUN, {"graph": {"pose_anees_from_start": score}}, Path("map.png"), Path("report.html"))[-1]
    assert last.startswith("no estimator")


@pytest.mark.parametrize(("display", "is_terminal", "shown"), [(":0", True, 1), (":0", False, 0), (None, True, 0)])
def test_a_page_is_opened_where_somebody_can_see_it(display, is_terminal, shown, opened, monkeypatch, tmp_path):
    monkeypatch.setattr(sys, "platform", "linux")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: is_terminal, raising=False)
    for name in SHOWN:
        monkeypatch.delenv(name, raising=False)
    if display is not None:
        monkeypatch.setenv("DISPLAY", display)
    open_page(tmp_path / "report.html")
    assert opened == [(tmp_path / "report.html").as_uri()][:shown]


def test_a_browser_that_cannot_be_started_is_no_error(monkeypatch, tmp_path):
    def fails(page):
        raise webbrowser.Error("no browser")

    monkeypatch.setattr(sys, "platform", "darwin")
    monkeypatch.setattr(sys.stdout, "isatty", lambda: True, raising=False)
    monkeypatch.setattr(webbrowser, "open", fails)
    open_page(tmp_path / "report.html")


def test_no_open_asks_no_browser(done, monkeypatch, tmp_path):
    asked = []
    monkeypatch.setattr(demo, "open_page", asked.append)
    assert main(["demo", "--out", str(tmp_path / "shown")]) == 0
    assert main(["demo", "--no-open", "--out", str(tmp_path / "kept")]) == 0
    assert asked == [tmp_path / "shown" / "replays" / "report.html"]


@pytest.mark.long
def test_it_leaves_a_map_and_a_report_in_which_only_the_block_diagonal_filter_is_overconfident(tmp_path, capsys):
    assert main(["demo", "--out", str(tmp_path)]) == 0
    explored, replayed, verdict = capsys.readouterr().out.splitlines()
    ran = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert ran["status"] == "complete"
    assert f"2 of 2 contours closed after {ran['steps']} steps" in explored
    assert (tmp_path / "run" / "map.png").is_file()
    report = (tmp_path / "replays" / "report.html").read_text()
    for name in ESTIMATORS:
        again = json.loads((tmp_path / "replays" / name / "summary.json").read_text())
        assert again["steps"] == ran["steps"]
        assert name in report
        assert f"{name} {again['pose_anees_from_start']:.3g}" in replayed
        assert (again["pose_anees_from_start"] > SCATTER[1]) == (name == "block-ekf")
    assert verdict.startswith("block-ekf is overconfident")
    (tmp_path / "run" / "config.json").unlink()
    assert main(["demo", "--out", str(tmp_path)]) == 2
    assert "--force" in capsys.readouterr().err
