"""Results of before: they can be looked at and replayed, and nothing goes on from them."""

import json
import shutil
from pathlib import Path

import pytest

from experiments.artifacts.formats import CONFIG, FORMATS, MOVED, RENAMED
from experiments.artifacts.saved import read_config
from experiments.artifacts.settings import defaults, leaves
from experiments.commands.cli import main
from experiments.commands.view import recordings_at
from slam.map.existence import ExistenceConfig

STORED = Path(__file__).parents[2] / "data" / "format1"
CAMPAIGN = (
    *("--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot", "--trials", "1"),
    *("--max-steps", "3", "--modes", "closed", "--jobs", "1"),
)


@pytest.fixture
def older(tmp_path):
    shutil.copytree(STORED, tmp_path, dirs_exist_ok=True)
    return tmp_path


def _is_in(group, keys):
    return any(key == group or key.startswith(f"{group}.") for key in keys)


@pytest.mark.parametrize("name", ["run", "other"])
def test_settings_that_still_hold_are_kept(name):
    said = json.loads((STORED / name / CONFIG).read_text())
    config, known = read_config(STORED / name / CONFIG), dict(leaves(defaults()))
    assert (said["format"], config.format) == (1, 1)
    assert config.unknown == ()
    current = [MOVED[group][0] if group in MOVED else group for group in RENAMED.values() if group]
    assert [group for group in current if not _is_in(group, known)] == []
    assert [group for group in RENAMED if not _is_in(group, dict(leaves(said["trial"])))] == []
    assert config.trial.p0 == said["trial"]["p0"] == ("large" if name == "other" else "small")
    assert config.trial.mission.explorer.sweep is (name == "run")
    assert config.trial.backend == ("graph" if name == "other" else "full-ekf")
    assert config.trial.max_steps == 3


def test_of_the_rules_before_existence_what_still_holds_is_kept(tmp_path):
    """Format 13: walls and lines of few beams were believed and forgotten by rules of their own."""
    trial = defaults() | {"world": "hall"}
    trial["mission"]["mapper"]["walls"] |= {"patience_m": 2.25, "claims": 6}
    del trial["mission"]["mapper"]["walls"]["existence"]
    trial["mission"]["mapper"]["candidates"] = {"longest_m": 0.18, "patience_m": 150.0, "slack_m": 0.02}
    path = tmp_path / CONFIG
    path.write_text(json.dumps({"format": 13, "trial": trial}))
    config = read_config(path)
    assert config.unknown == ()
    assert config.trial.mission.mapper.walls.existence == ExistenceConfig(slack_m=0.02)


@pytest.mark.parametrize("name", ["run", "other"])
def test_an_older_run_is_replayed_and_what_means_nothing_now_is_told(name, older, capsys):
    out, config = older / "replayed", older / name / CONFIG
    said = json.loads(config.read_text())
    said["trial"]["mission"]["wings"] = {"span_m": 3.0}
    said["trial"]["mission"]["mapper"]["walls"]["pieces"]["sure_gap_m"] = 0.4
    config.write_text(json.dumps(said))
    assert main(["replay", str(older / name / "log.npz"), "--out", str(out)]) == 0
    (said,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("chainslam: ")]
    assert "format 1" in said
    assert said.endswith("left aside: mission.wings.span_m")
    written = json.loads((out / CONFIG).read_text())
    assert written["format"] == FORMATS[CONFIG]
    assert written["trial"]["mission"]["mapper"]["shared"]["door_m"] == 0.4
    assert json.loads((out / "summary.json").read_text())["steps"] == 3


@pytest.mark.usefixtures("_unchecked")
def test_an_older_run_and_an_older_campaign_can_be_looked_at(older):
    run, campaign = older / "run", older / "campaign"
    assert main(["measure", str(run)]) == 0
    assert main(["report", str(run)]) == 0
    assert [path.stat().st_size > 0 for path in recordings_at(run)()] == [True]
    assert main(["report", str(campaign)]) == 0
    assert main(["compare", "--against", str(campaign), str(campaign), "--out", str(older / "contrast")]) == 0


def test_nothing_goes_on_from_an_older_run_or_campaign(older, capsys):
    def files():
        return {path: path.read_bytes() for path in older.rglob("*") if path.is_file()}

    run, campaign, before = str(older / "run"), str(older / "campaign"), files()
    for words, todo in (
        (["explore", "--resume", run], "explore anew with --force"),
        (["explore", "paper-fig4", "--max-steps", "3", "--out", run], "let --force replace"),
        (["explore", "paper-fig4", "--config", f"{run}/{CONFIG}", "--out", str(older / "new")], "config.json"),
        (["compare", *CAMPAIGN, "--out", campaign], "name another with --out"),
        (["compare", "--merge", campaign, campaign, "--out", str(older / "merged")], "run it again"),
    ):
        assert main(words) == 2
        said = capsys.readouterr().err
        assert said.count("\n") == 1
        assert "format 1" in said or f"format {FORMATS[CONFIG]}" in said
        assert todo in said
    assert files() == before
