"""Whoever reads the output may leave, the disk may be full, a stream may be closed: no traceback, a sensible status."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

from chainslam.experiments.commands import cli
from chainslam.experiments.commands.cli import main
from chainslam.experiments.terminal.streams import MOST_LETTERS, one_line

ROOT = Path(__file__).parents[3]


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("run")
    assert main(["explore", "paper-fig4", "--max-steps", "4", "--out", str(folder)]) == 0
    return folder


def deaf():
    """Return the writing end of a pipe that nobody reads."""
    reading, writing = os.pipe()
    os.close(reading)
    return writing


def ended(words, tmp_path, out, err="kept"):
    """Run a command in a process with other streams; return its status and what it said on standard error."""
    said = tmp_path / "said"
    said.touch()
    child = os.fork()
    if child == 0:
        status = 70
        try:
            os.chdir(tmp_path)
            ways = {"kept": str(said), "closed": "/dev/null"}
            opened = [deaf() if how == "deaf" else os.open(ways.get(how, how), os.O_WRONLY) for how in (out, err)]
            streams = []
            for descriptor, how in ((1, out), (2, err)):
                os.dup2(opened[descriptor - 1], descriptor)
                streams.append(None if how == "closed" else os.fdopen(descriptor, "w", closefd=False))
            for descriptor, how in ((1, out), (2, err)):
                if how == "closed":
                    os.close(descriptor)
            sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__ = streams
            status = main(words)
        except SystemExit as leaving:
            status = leaving.code
        finally:
            os._exit(status)
    _, status = os.waitpid(child, 0)
    return os.waitstatus_to_exitcode(status), said.read_text()


@pytest.fixture
def commands(run):
    return [
        ["worlds"],
        ["--help"],
        ["measure", str(run)],
        ["explore", "paper-fig4", "--max-steps", "2", "--out", "out"],
    ]


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
def test_the_longer_commands_end_in_zero_though_nobody_reads(run, tmp_path):
    compare = ["compare", "--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot"]
    compare += ["--modes", "closed", "--trials", "1", "--max-steps", "2", "--jobs", "1", "--out", "campaign"]
    for words in (compare, ["replay", str(run / "log.npz"), "--out", "replayed"], ["report", str(run)]):
        assert ended(words, tmp_path, "deaf") == (0, ""), words
    assert (tmp_path / "campaign" / "comparison.json").is_file()


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize(("out", "status"), [("deaf", 0), ("closed", 0), ("/dev/full", 1)])
def test_a_command_ends_as_it_should_though_nobody_takes_what_it_prints(commands, tmp_path, out, status):
    for words in commands:
        found, said = ended(words, tmp_path, out)
        assert found == status, words
        assert len(said.splitlines()) == status
        assert "Traceback" not in said
        assert "No space left" in said or not status
    assert (tmp_path / "out" / "summary.json").is_file()


@pytest.mark.filterwarnings("ignore:.*fork:DeprecationWarning")
@pytest.mark.parametrize("err", ["deaf", "closed", "/dev/full"])
def test_bad_usage_ends_in_two_though_nobody_is_told(tmp_path, err):
    assert ended(["fly"], tmp_path, "kept", err) == (2, "")
    assert ended(["fly"], tmp_path, "closed", err) == (2, "")


def test_a_closed_stream_keeps_its_place_from_other_files(tmp_path, run):
    assert ended(["report", str(run)], tmp_path, "closed", "closed")[0] == 0
    assert (run / "report.html").read_bytes().startswith(b"<!")
    assert (run / "report.html").read_bytes().rstrip().endswith(b"</html>")


def test_the_module_ends_like_the_command():
    with subprocess.Popen(
        [sys.executable, "-m", "chainslam.experiments.commands.cli", "worlds"],
        cwd=ROOT,
        stdout=deaf(),
        stderr=subprocess.PIPE,
        text=True,
    ) as process:
        assert process.communicate(timeout=60)[1] == ""
    assert process.returncode == 0


def test_a_message_is_one_line_that_moves_no_cursor_and_ends():
    assert one_line("a\n b\x1b[31m\x07\udcff") == "a b\\x1b[31m\\x07\\udcff"
    long = one_line("expected " + "9" * 5000 + ": do this")
    assert len(long) < MOST_LETTERS + 9
    assert long.startswith("expected 9")
    assert long.endswith("9: do this")


@pytest.mark.parametrize(
    ("error", "status"),
    [
        (OSError(36, "File name too long", "x" * 300), 2),
        (OSError(28, "No space left on device", "map.png"), 1),
        (MemoryError(), 1),
    ],
)
def test_what_no_command_foresaw_is_one_line_still(error, status, monkeypatch, capsys):
    def fails(arguments):
        raise error

    monkeypatch.setattr(cli, "_parse", fails)
    assert main(["worlds"]) == status
    (line,) = capsys.readouterr().err.splitlines()
    assert line.startswith("chainslam: expected ")


def test_a_name_that_no_file_can_have_is_one_line(capsys):
    for words in (["view", "9" * 5000], ["report", "9" * 5000], ["measure", "9" * 5000, "0", "1"]):
        assert main(words) == 2
        (line,) = capsys.readouterr().err.splitlines()
        assert line.startswith("chainslam: expected ")
