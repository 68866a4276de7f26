"""A file is known as the command's own wherever it stands, and a run's folder stands for its file."""

import numpy as np
import pytest

from chainslam.experiments.commands.cli import COMMANDS, main
from chainslam.experiments.commands.replay import Replay
from chainslam.experiments.terminal.word_order import (
    MANY,
    _positional,
    _values,
    file_in,
    in_order,
    swallowed,
    with_files,
)

CLASSES = {name: entry.load() for name, entry in COMMANDS.items()}
GREEDY = [
    (name, option)
    for name, command in CLASSES.items()
    if _positional(command)
    for option, most in _values(command).items()
    if most == MANY
]


def test_options_of_many_values_are_known():
    assert ("replay", "--backend") in GREEDY
    assert ("explore", "--without") in GREEDY
    assert _values(CLASSES["explore"])["--set"] == 1
    assert "--force" not in _values(CLASSES["explore"])
    assert _values(CLASSES["compare"])["--against"] == 2


@pytest.mark.parametrize(("name", "option"), GREEDY)
@pytest.mark.parametrize("seed", range(3))
def test_a_file_after_an_option_of_many_values_is_the_commands(name, option, seed, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "a file.x").write_text("")
    rng = np.random.default_rng(seed)
    values = [f"v{k}" for k in range(int(rng.integers(1, 4)))]
    others = [["--force"], ["--out", "o"], ["--set", "a=b"]]
    known = {"--force", *_values(CLASSES[name])}
    before = [
        word for k in rng.permutation(3)[: int(rng.integers(0, 3))] if others[k][0] in known for word in others[k]
    ]
    after = ["--rrd", "r"] if rng.random() < 0.5 and "--rrd" in known else []
    rest = [*before, option, *values]
    assert in_order([name, *rest, "a file.x", *after], CLASSES[name]) == [name, "a file.x", *rest, *after]
    # What is not there, what is the only value, and a file beside one that stands alone are left where they are.
    for words in ([*rest, "no.x", *after], [*before, option, "a file.x"], ["a file.x", *rest, "a file.x"]):
        assert in_order([name, *words], CLASSES[name]) == [name, *words]
    assert in_order([name, *rest, "--p0", "x", "y", "a file.x"], CLASSES[name])[1] == rest[0]


def test_what_took_the_log_is_told(capsys):
    assert main(["replay", "--backend", "full-ekf", "none.log", "--force"]) == 2
    expected = "chainslam: expected LOG for replay, found none (--backend takes 'none.log' as well): put it first\n"
    assert capsys.readouterr().err == expected
    assert main(["replay"]) == 2
    assert capsys.readouterr().err == "chainslam: expected LOG for replay, found none: see `chainslam replay --help`\n"
    assert main(["measure"]) == 2
    assert capsys.readouterr().err.startswith("chainslam: expected DIR for measure, found none: see ")
    assert swallowed(["replay", "a.log"], Replay) == ""


def test_the_folder_of_a_run_stands_for_its_files(tmp_path):
    for name in ("log.npz", "config.json"):
        (tmp_path / name).write_text("")
    command = with_files(Replay(tmp_path, config=tmp_path, out=tmp_path))
    assert (command.log, command.config, command.out) == (tmp_path / "log.npz", tmp_path / "config.json", tmp_path)
    assert file_in(tmp_path, "none") == tmp_path
    assert file_in(tmp_path / "log.npz", "log.npz") == tmp_path / "log.npz"
