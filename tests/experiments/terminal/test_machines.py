"""Machines that are not ours: terminals of no width, unset variables, home folders, locales."""

import os
import subprocess
import sys

import pytest

from chainslam.experiments.commands import cli
from chainslam.experiments.commands.cli import COMMANDS, main
from chainslam.experiments.terminal.parsing import options_of

ASCII = {"PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"}
"""Python takes UTF-8 in the C locale unless this forbids it."""
VALUED = [
    (command, option)
    for command, entry in COMMANDS.items()
    for option in options_of(entry.load())
    if f"--no-{option[2:]}" not in options_of(entry.load()) and not option.startswith("--no-")
]


@pytest.mark.parametrize(("command", "option"), VALUED)
def test_an_empty_value_is_refused_for_every_option(command, option, capsys, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    for words in ([f"{option}="], [option, ""]):
        assert main([command, "x", *words]) == 2
        assert capsys.readouterr().err == (
            f"chainslam: expected a value for {option}, found an empty one: is a variable not set?\n"
        )
    assert list(tmp_path.iterdir()) == []


def test_an_empty_word_is_refused_in_place_of_a_world_or_a_log(capsys):
    for command in ("explore", "replay", "view", "report", "measure"):
        assert main([command, ""]) == 2
        assert "found an empty one" in capsys.readouterr().err


@pytest.mark.parametrize("word", ["~/runs/a", "~"])
def test_home_is_put_in_where_no_shell_does(word, monkeypatch):
    monkeypatch.setenv("HOME", "/home/alice")
    at_home = word.replace("~", "/home/alice")
    for before in ("--out=", "", "--rrd="):
        assert cli._at_home(before + word) == before + at_home
    for kept in ("a~", "x~/y", "--set=a=~/b", "~alice/x"):
        assert cli._at_home(kept) == kept


@pytest.mark.parametrize(("said", "left"), [("0", None), ("00", None), (" ", None), ("", None), ("120", "120")])
def test_a_terminal_of_no_columns_is_one_of_unknown_width(said, left, monkeypatch):
    monkeypatch.setenv("COLUMNS", said)
    monkeypatch.setattr(cli, "main", lambda: 0)
    monkeypatch.setattr(cli, "too_late", lambda: None)
    assert cli.process() == 0
    assert os.environ.get("COLUMNS") == left


def test_names_of_files_are_read_in_a_locale_of_ascii_only(tmp_path):
    (tmp_path / "Büro 漢.svg").write_text('<svg xmlns="http://www.w3.org/2000/svg"/>')
    plain = {name: value for name, value in os.environ.items() if not name.startswith(("LC_", "LANG", "PYTHONUTF8"))}
    words = [sys.executable, "-m", "chainslam.experiments.commands.cli", "explore", "Büro 漢.svg"]
    found = subprocess.run(
        words, cwd=tmp_path, env={**plain, "LC_ALL": "C", "PYTHONPATH": os.getcwd(), **ASCII}, capture_output=True,
    )  # fmt: skip
    assert found.returncode == 2
    assert "shapes in the SVG file, found none: draw the walls" in found.stderr.decode()
