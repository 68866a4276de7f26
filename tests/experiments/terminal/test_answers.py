"""`--json` prints what a command found and nothing else, `--quiet` nothing; the files stay as they were."""

import json

import pytest

from chainslam.experiments.commands.cli import COMMANDS, main
from chainslam.experiments.terminal import answers


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert main(["explore", "paper-fig4", "--errorless", "--no-sweep", "--out", str(folder)]) == 0
    return folder


def written(folder):
    """Return the summary in a folder, without the number of its format."""
    said = json.loads((folder / "summary.json").read_text())
    del said["format"]
    return said


def told(capsys, *words):
    assert main([*words, "--quiet"]) == 0
    assert capsys.readouterr().out == ""
    assert main([*words, "--json"]) == 0
    out = capsys.readouterr().out
    assert json.dumps(json.loads(out), indent=1, ensure_ascii=False) + "\n" == out
    return json.loads(out)


def test_a_run_tells_its_summary_and_folder(capsys, tmp_path):
    words = ["explore", "paper-fig4", "--errorless", "--max-steps", "2", "--out", str(tmp_path / "a"), "--force"]
    said = told(capsys, *words)
    assert said["summary"] == written(tmp_path / "a")
    assert said["folder"] == str(tmp_path / "a")


def test_a_replay_tells_the_summary_of_each_back_end(run, capsys, tmp_path):
    words = ["replay", str(run), "--backend", "full-ekf", "block-ekf", "--out", str(tmp_path), "--force"]
    said = told(capsys, *words)
    assert list(said["summaries"]) == ["full-ekf", "block-ekf"]
    for name, summary in said["summaries"].items():
        assert summary == written(tmp_path / name)


def test_a_campaign_tells_its_means_and_verdict(capsys, tmp_path):
    names = ["--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot", "--modes", "closed"]
    said = told(capsys, "compare", *names, "--trials", "1", "--max-steps", "2", "--jobs", "1", "--out", str(tmp_path))
    assert [row["backend"] for row in said["pooled"]] == ["full-ekf"]
    assert said["folder"] == str(tmp_path)
    assert said["verdict"]


def test_a_map_tells_its_corners_rooms_and_distances(run, capsys):
    said = told(capsys, "measure", str(run))
    assert said["rooms"][0]["area_interval_m2"][0] <= said["rooms"][0]["area_m2"]
    first, second = said["corners"][0], said["corners"][1]
    pair = told(capsys, "measure", str(run), "0", "1")
    apart = sum((a - b) ** 2 for a, b in zip(first["position_m"], second["position_m"], strict=True)) ** 0.5
    assert pair["distance_m"] == pytest.approx(apart)
    assert pair["interval_m"][0] < pair["distance_m"] < pair["interval_m"][1]


@pytest.mark.parametrize("name", ["worlds", "backends", "strategies"])
def test_a_listing_tells_its_names(name, capsys):
    assert main([name]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert list(told(capsys, name)["names"]) == [line.split()[0] for line in lines]


def test_a_report_tells_its_file(run, capsys):
    assert told(capsys, "report", str(run)) == {"report": str(run / "report.html")}


def test_errors_are_told_and_nothing_is_left_over(run, capsys):
    for words in (["measure", str(run), "0", "900"], ["explore", "no such world"]):
        for option in ("--json", "--quiet"):
            assert main([*words, option]) == 2
            said = capsys.readouterr()
            assert said.out == ""
            assert said.err.startswith("chainslam: expected ")
    assert not answers.is_quiet()
    assert main(["worlds", "--json", "--quiet"]) == 2
    assert "found both" in capsys.readouterr().err


@pytest.mark.parametrize("name", COMMANDS)
def test_every_command_has_both(name, capsys):
    with pytest.raises(SystemExit):
        main([name, "--help"])
    said = capsys.readouterr().out
    assert "--json" in said
    assert "--quiet" in said
    assert "--no-json" not in said
