"""`--preset paper-method`: what it stands for, what goes before it, and the method among a campaign's back ends."""

import json
import re
import shlex
from pathlib import Path

import pytest

from chainslam.experiments.artifacts.presets import METHODS
from chainslam.experiments.artifacts.settings import defaults, differing, leaves, record_of
from chainslam.experiments.campaign.comparison.tables import read_rows
from chainslam.experiments.campaign.plan import CLOSED, Trial, command_of, config_of
from chainslam.experiments.commands.cli import _parse, main
from chainslam.experiments.scenario import TrialConfig

DOCS = Path(__file__).parents[3] / "docs" / "concepts" / "exploration.md"
METHOD = "mission.mapper.matching.method"
DEFAULTS = dict(leaves(defaults()))
MERGING = "mission.mapper.merging"
PRESET = ("--preset", "paper-method")


def trial(*words):
    return _parse(["explore", "paper-fig9", *words])[0].trial


def campaign(*words):
    return _parse(["compare", "--out", "DIR", *words])[0].campaign


def test_the_preset_is_what_the_page_says():
    page = DOCS.read_text().partition("## The paper's method")[2].partition("\n## ")[0]
    told = dict(re.findall(r"`([a-z_.]+)=([^`]+)`", page))
    said = {key: json.loads(value) if value in ("null", "false") else value for key, value in told.items()}
    assert said == dict(leaves(METHODS["paper-method"].record))
    asked = dict(leaves(record_of(trial(*PRESET))))
    assert said == {key: asked[key] for key in said}
    groups = tuple(f"{key}." for key in said)
    others = {key for key in DEFAULTS.keys() | asked.keys() if asked.get(key) != DEFAULTS.get(key)} - said.keys()
    assert {key for key in others if not key.startswith(groups)} == {"world"}


def test_an_option_goes_before_set_and_that_before_a_file_and_that_before_the_preset(tmp_path):
    plain = trial(*PRESET)
    mapper, explorer = plain.mission.mapper, plain.mission.explorer
    assert (plain.backend, mapper.matching.method, explorer.following.navigation) == (
        "block-ekf",
        "paper",
        "visibility",
    )
    assert (mapper.merging, explorer.sweep) == (None, False)
    path = tmp_path / "some.json"
    path.write_text(json.dumps({"backend": "graph", "mission": {"mapper": {"matching": {"method": "joint"}}}}))
    file = (*PRESET, "--config", str(path))
    assert (trial(*file).backend, trial(*file).mission.mapper.matching.method) == ("graph", "joint")
    sets = (*file, "--set", "backend=fej-ekf", "--set", f"{METHOD}=paper")
    assert (trial(*sets).backend, trial(*sets).mission.mapper.matching.method) == ("fej-ekf", "paper")
    assert trial(*sets, "--backend", "full-ekf").backend == "full-ekf"
    assert trial(*PRESET, "--sweep", "--navigation", "floor").mission.explorer.sweep is True
    assert trial(*PRESET, "--navigation", "floor").mission.explorer.following.navigation == "floor"
    assert trial() == TrialConfig("paper-fig9", "graph")


@pytest.mark.parametrize("command", ["explore", "compare"])
def test_an_unknown_preset_is_told_in_one_line(command, capsys):
    assert main([command, *(["hall"] if command == "explore" else ["--out", "DIR"]), "--preset", "papers"]) == 2
    (line,) = capsys.readouterr().err.splitlines()
    assert "paper-method" in line


def test_a_saved_run_has_settled_its_preset(tmp_path, capsys):
    assert main(["explore", "--resume", str(tmp_path), *PRESET]) in (1, 2)
    words = ["explore", "paper-fig4", *PRESET, "--max-steps", "2", "--out", str(tmp_path / "run")]
    assert main(words) == 0
    capsys.readouterr()
    assert main(["explore", "--resume", str(tmp_path / "run"), *PRESET]) == 2
    assert "found preset: leave it out" in capsys.readouterr().err
    said = json.loads((tmp_path / "run" / "config.json").read_text())["trial"]
    assert (said["backend"], said["mission"]["mapper"]["matching"]["method"]) == ("block-ekf", "paper")


def test_the_campaign_holds_the_method_against_todays_mapper_on_the_same_driving():
    settled = campaign(*PRESET)
    assert settled.backends == ("paper-method", "block-ekf", "full-ekf", "invariant-ekf")
    assert settled.worlds == ("paper-fig8", "paper-fig9")

    def of(backend, settled=settled):
        return config_of(settled, Trial("paper-fig9", "nearest-robot", backend, CLOSED, 1))

    paper, today = of("paper-method"), of("block-ekf")
    assert paper.backend == today.backend == "block-ekf"
    assert dict(differing(paper)).keys() - dict(differing(today)).keys() == {METHOD, MERGING}
    assert (paper.mission.explorer, paper.max_steps) == (today.mission.explorer, 1000)
    assert today.mission.explorer == trial(*PRESET).mission.explorer
    assert paper.mission.mapper == trial(*PRESET).mission.mapper
    for words in ((), ("--set", f"{METHOD}=joint"), ("--set", "mission.mapper.matching.gate=0.9")):
        asked = campaign(*PRESET, *words)
        assert _parse(shlex.split(command_of(asked))[1:])[0].campaign == asked
    by_joint, on_floor = campaign(*PRESET, "--set", f"{METHOD}=joint"), campaign(*PRESET, "--navigation", "floor")
    assert of("paper-method", by_joint).mission.mapper.matching.method == "joint"
    assert of("paper-method", on_floor).mission.explorer.following.navigation == "floor"


def test_the_method_is_a_row_of_a_campaign_driven_and_replayed(tmp_path):
    words = ["--worlds", "paper-fig4", "--trials", "1", "--max-steps", "24", "--jobs", "1", "--out", str(tmp_path)]
    words += ["--backends", "paper-method", "block-ekf", "--association", "own", "--rrd", str(tmp_path / "a.rrd")]
    words += ["--set", "mission.mapper.matching.gate=0.5"]  # soon the one enters walls twice, the other never
    assert main(["compare", *PRESET, *words]) == 0
    of = {(row["backend"], row["mode"]): row["pose_rmse_m"] for row in read_rows(tmp_path / "trials.parquet")}
    assert list(of) == [(name, mode) for name in ("paper-method", "block-ekf") for mode in ("closed", "replay")]
    assert len(set(of.values())) == 4
    assert main(["report", str(tmp_path)]) == 0
