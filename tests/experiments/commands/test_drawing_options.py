"""What is said of a drawing reaches every way to run in it, and is in config.json so that the run can be made again."""

import json

import pytest

import chainslam
from chainslam.experiments.commands.cli import main

SVG = '<svg xmlns="http://www.w3.org/2000/svg" viewBox="0 0 10 8"><rect x="1" y="1" width="8" height="6" fill="none"'
SVG += ' stroke="black"/><g id="furniture"><rect x="2" y="2" width="2" height="2"/></g></svg>'
SAID = {"scale": 0.5, "without": ["furniture"]}
WORDS = ["--scale", "0.5", "--without", "furniture"]


@pytest.fixture
def plan(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "plan.svg").write_text(SVG)
    return tmp_path


def _config(folder) -> dict:
    return json.loads((folder / "config.json").read_text())["trial"]["drawing"]


def test_explore_writes_them_and_a_run_of_its_config_is_the_same(plan, capsys):
    assert main(["explore", "plan.svg", *WORDS, "--max-steps", "2", "--out", "one"]) == 0
    assert "0.5 m a unit, given" in capsys.readouterr().out
    assert {key: value for key, value in _config(plan / "one").items() if key in SAID} == SAID
    assert main(["explore", "plan.svg", "--config", "one/config.json", "--max-steps", "2", "--out", "two"]) == 0
    assert (plan / "one" / "map.geojson").read_bytes() == (plan / "two" / "map.geojson").read_bytes()
    assert main(["report", "two"]) == 0
    assert "drawing.scale" in (plan / "two" / "report.html").read_text()


def test_python_takes_them_by_name(plan):
    run = chainslam.explore("plan.svg", scale=0.5, without=["furniture"], max_steps=2, out="one")
    assert {key: value for key, value in _config(run.folder).items() if key in SAID} == SAID


def test_compare_takes_them_for_all_its_worlds(plan):
    words = ["--worlds", "plan.svg", "--backends", "full-ekf", "--strategies", "nearest-robot", "--trials", "1"]
    assert main(["compare", *words, *WORDS, "--max-steps", "2", "--jobs", "1", "--out", "both"]) == 0
    said = json.loads((plan / "both" / "config.json").read_text())["campaign"]["settings"]
    assert dict(map(tuple, said)) == {f"drawing.{key}": value for key, value in SAID.items()}


@pytest.mark.parametrize(
    ("words", "told"),
    [
        (["--scale", "-1"], "-1.0 where scale should be a number from 1e-09"),
        (["--threshold", "7"], "7.0 where threshold should be a number from 1e-06 to 1"),
        (["--level", "2"], "no --level for an SVG file"),
        (["--layers", "walls"], "--layers of the drawing ('furniture')"),
        (["--set", "drawing.negate=true"], "no --negate"),
    ],
)
def test_what_means_nothing_ends_in_one_line(plan, capsys, words, told):
    assert main(["explore", "plan.svg", *words, "--out", "no"]) == 2
    err = capsys.readouterr().err
    assert told in err
    assert err.count("\n") == 1
    assert not (plan / "no").exists()


def test_what_was_not_understood_is_echoed(plan, capsys):
    (plan / "odd.svg").write_text(
        SVG.replace("<g id", '<rect fill="#fff" style="fill:blak" width="1" height="1"/><g id')
    )
    assert main(["explore", "odd.svg", "--max-steps", "1", "--out", "odd"]) == 0
    out = capsys.readouterr().out
    assert "note: not understood" in out
    assert "fill blak" in out
