import json

import pytest

from chainslam.experiments.commands.cli import main
from chainslam.experiments.views.numbers import number


@pytest.mark.parametrize("listing", ["worlds", "backends", "strategies"])
def test_listings_start_each_line_with_a_name(listing, capsys):
    assert main([listing]) == 0
    lines = capsys.readouterr().out.splitlines()
    assert lines
    assert all(len(line.split(maxsplit=1)) == 2 for line in lines)


@pytest.mark.parametrize(
    "arguments",
    [
        [],
        ["fly"],
        ["fly", "--help"],
        ["explore"],
        ["explore", "no-such-world"],
        ["explore", "no-such-world.json"],
        ["explore", "random:seven"],
        ["explore", "paper-fig8", "--backend", "magic"],
        ["explore", "paper-fig8", "--strategy", "magic"],
        ["explore", "paper-fig8", "--p0", "huge"],
        ["explore", "paper-fig8", "--seed", "one"],
        ["explore", "paper-fig8", "--seed", "-1"],
        ["explore", "paper-fig8", "--max-steps", "0"],
        ["explore", "paper-fig8", "--wings"],
        *(["explore", "paper-fig8", option, value]
          for option in ("--max-path", "--time-limit", "--scale") for value in ("nan", "inf", "0", "1e400")),
        *(["explore", "paper-fig8", "--start", *pose] for pose in (("nan", "1"), ("1", "inf"), ("1",), ("1",) * 4)),
        *(["explore", "paper-fig8", option, "9" * 5000] for option in ("--seed", "--max-steps", "--backend")),
    ],
    ids=lambda words: " ".join(words)[:60],
)  # fmt: skip
def test_bad_usage_ends_in_two_and_one_line(arguments, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    assert main(arguments) == 2
    said = capsys.readouterr()
    assert said.out == ""
    assert said.err.startswith("chainslam: ")
    assert len(said.err.strip().splitlines()) == 1
    assert not list(tmp_path.iterdir())


def test_a_folder_that_cannot_be_made_is_told_before_anything_is_computed(capsys, tmp_path):
    (tmp_path / "file").write_text("in the way")
    assert main(["explore", "paper-fig8", "--out", str(tmp_path / "file" / "run")]) == 2
    assert "--out" in capsys.readouterr().err


def test_explore_leaves_its_folder_and_ends_in_three_lines(capsys, tmp_path):
    assert main(["explore", "paper-fig8", "--max-steps", "5", "--out", str(tmp_path / "run")]) == 0
    said = capsys.readouterr()
    expected, happened, consistent, where = said.out.splitlines()[-4:]
    assert expected.startswith("expected, roughly")
    summary = json.loads((tmp_path / "run" / "summary.json").read_text())
    assert summary["reason"] in happened
    for name in ("pose_anees_from_start", "map_anees"):
        assert number(summary[name]) in consistent
    assert str(tmp_path / "run") in where
    assert said.err == ""
    assert {"summary.json", "map.png", "log.npz"} <= {path.name for path in (tmp_path / "run").iterdir()}


def test_a_world_is_called_by_its_name_though_that_is_an_emoji(capsys, tmp_path):
    assert main(["explore", "random:1234", "--max-steps", "2", "--out", str(tmp_path / "[/run]")]) == 0
    said = capsys.readouterr().out
    assert "world random:1234:" in said
    assert "[/run]" in said


def test_help_ends_in_zero(capsys):
    with pytest.raises(SystemExit) as leaving:
        main(["explore", "--help"])
    assert leaving.value.code == 0
    assert "--errorless" in capsys.readouterr().out
