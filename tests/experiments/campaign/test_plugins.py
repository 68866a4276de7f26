"""Parts of others: from a file or an installed distribution, in listings, runs, campaigns and reports."""

from importlib.metadata import EntryPoint, EntryPoints
from pathlib import Path

import pytest

import chainslam
from chainslam.experiments.campaign import plugins
from chainslam.experiments.commands.cli import main
from chainslam.explore import strategies
from chainslam.sim.worlds import registry
from chainslam.slam import backends

EXAMPLES = Path(__file__).parents[3] / "examples"
PLUGIN = """
from dataclasses import dataclass
import chainslam
from chainslam.slam.backends.full_ekf import FullEkf

@dataclass(frozen=True)
class ShyConfig:
    times: float = 2.0

class Shy(FullEkf):
    def __init__(self, pose, cov, config):
        super().__init__(pose, config.times**2 * cov)

chainslam.BACKENDS["shy"] = chainslam.BackendEntry(Shy, "starts less sure", options=ShyConfig)
"""


@pytest.fixture(autouse=True)
def _forgotten():
    """Leave the registries as they were."""
    known = [(each, dict(each)) for each in (backends.BACKENDS, strategies.STRATEGIES, registry.READERS)]
    yield
    for each, before in known:
        each.clear()
        each.update(before)


@pytest.fixture
def shy(tmp_path):
    path = tmp_path / "shy.py"
    path.write_text(PLUGIN)
    return str(path)


def test_a_file_adds_its_parts_to_the_listing(shy, capsys):
    assert main(["backends", "--plugin", shy]) == 0
    assert "starts less sure" in capsys.readouterr().out
    assert main(["strategies", f"--plugin={EXAMPLES / 'own_strategy.py'}", "--plugin", shy]) == 0
    assert "farthest" in capsys.readouterr().out


def test_options_of_ones_own_decide_a_run_and_stand_in_its_config(shy, tmp_path):
    told = {}
    for times in ("1", "3"):
        words = ["--backend", "shy", "--plugin", shy, "--set", f"backend_options.own.ShyConfig.times={times}"]
        assert main(["explore", "paper-fig4", "--max-steps", "2", "--out", str(tmp_path / times), *words]) == 0
        told[times] = chainslam.load(tmp_path / times).steps["cov_tt"][0]
    assert told["3"] > 2.0 * told["1"]
    assert '"ShyConfig"' in (tmp_path / "3" / "config.json").read_text()


@pytest.mark.parametrize(
    ("said", "words"),
    [
        ("backend_options.own.ShyConfig.time=1", "did you mean times"),
        ('backend_options.own.ShyConfig.times="x"', "Expected `float`"),
        ("backend_options.own.BoldConfig.times=1", "own.BoldConfig"),
    ],
)
def test_options_that_are_none_are_told_in_one_line(said, words, shy, capsys):
    assert main(["explore", "paper-fig4", "--backend", "shy", "--plugin", shy, "--set", said]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert len(told.splitlines()) == 1


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ("x = 1", "adds nothing"),
        ("1 / 0", "ZeroDivisionError"),
        ("def", "SyntaxError"),
        (None, "found no plugin.py"),
    ],
)
def test_a_file_that_adds_nothing_is_told_in_one_line(text, words, tmp_path, capsys):
    path = tmp_path / "plugin.py"
    if text is not None:
        path.write_text(text)
    assert main(["backends", "--plugin", str(path)]) == 2
    told = capsys.readouterr().err
    assert words in told
    assert len(told.splitlines()) == 1


def test_what_a_part_left_is_reported_and_measured_where_the_part_is_not(shy, tmp_path, capsys):
    out = str(tmp_path / "run")
    assert main(["explore", "paper-fig4", "--backend", "shy", "--plugin", shy, "--max-steps", "3", "--out", out]) == 0
    campaign = ["compare", "--worlds", "paper-fig4", "--backends", "shy", "--strategies", "farthest", "--trials", "2"]
    files = ["--plugin", shy, "--plugin", str(EXAMPLES / "own_strategy.py")]
    whole = [*campaign, "--max-steps", "3", "--out", str(tmp_path / "campaign"), "--jobs", "2"]
    assert main([*whole, *files]) == 0
    del backends.BACKENDS["shy"], strategies.STRATEGIES["farthest"]
    for words in (["report", out], ["measure", out], ["report", str(tmp_path / "campaign")]):
        assert main(words) == 0
    capsys.readouterr()
    for words in (["explore", "--resume", out, "--max-steps", "5"], whole):
        assert main(words) == 2
        assert "--plugin" in capsys.readouterr().err


class Installed:
    """A distribution of a name."""

    name = "shy-slam"


def test_what_is_installed_is_registered_and_what_cannot_be_is_told(monkeypatch, capsys):
    entry = chainslam.BackendEntry(lambda *start: None, "installed")
    monkeypatch.setattr(plugins, "_looked", [])
    monkeypatch.setattr(EntryPoint, "load", lambda point: {"good": entry}[point.value])
    monkeypatch.setattr(EntryPoint, "dist", Installed())
    points = [
        EntryPoint(name, value, "chainslam.backends") for name, value in (("shy", "good"), ("ukf", "good"), ("a", "b"))
    ]
    monkeypatch.setattr(plugins, "entry_points", lambda: EntryPoints(points))
    for _ in range(2):
        plugins.register_installed()
    assert backends.BACKENDS["shy"] is entry
    assert backends.BACKENDS["ukf"] is not entry
    told = capsys.readouterr().err.splitlines()
    assert [line.partition(": ignored the plug-in ")[2].partition(" of shy-slam: ")[::2] for line in told] == [
        ("good", "ValueError: the name ukf is taken"),
        ("b", "KeyError: 'b'"),
    ]
