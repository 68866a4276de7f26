"""What --config and --set mean to campaigns, replays and saved runs, and what is told of them afterwards."""

import json
import shlex
from dataclasses import replace

import pytest

from chainslam.experiments.artifacts.files import json_bytes
from chainslam.experiments.artifacts.results import config_record
from chainslam.experiments.artifacts.saved import read_trial
from chainslam.experiments.artifacts.settings import asked, parse_settings
from chainslam.experiments.campaign.comparison.tables import doubles
from chainslam.experiments.campaign.plan import CLOSED, Trial, command_of, config_of, gate_of
from chainslam.experiments.commands.cli import _parse, main
from chainslam.experiments.views.run_page import run_page

GATE = "mission.mapper.matching.gate"


@pytest.fixture(scope="module")
def run(tmp_path_factory):
    folder = tmp_path_factory.mktemp("settings") / "run"
    assert main(["explore", "paper-fig4", "--max-steps", "3", "--set", f"{GATE}=0.9", "--out", str(folder)]) == 0
    return folder


def campaign(*words):
    preset = () if "--preset" in words else ("--preset", "smoke")
    return _parse(["compare", *preset, "--out", "DIR", *words])[0].campaign


def test_a_campaign_takes_from_a_file_what_no_option_says(tmp_path):
    path = tmp_path / "some.json"
    path.write_text(json.dumps({"world": "hall", "p0": "large", "max_steps": 7, "time_limit_s": 9.0}))
    file = ("--config", str(path))
    assert (campaign().p0, campaign().max_steps) == ("small", 5000)
    assert (campaign(*file).p0, campaign(*file).max_steps, campaign(*file).worlds) == ("large", 7, ("paper-fig8",))
    assert campaign(*file, "--set", "p0=zero", "--set", "max_steps=8").max_steps == 8
    assert campaign(*file, "--set", "p0=zero").p0 == "zero"
    typed = campaign(*file, "--set", "p0=zero", "--p0", "small", "--max-steps", "5000")
    assert (typed.p0, typed.max_steps) == ("small", 5000)
    assert campaign(*file).settings == (("time_limit_s", 9.0),)


def test_the_campaign_of_the_paper_goes_by_walls_unless_told_otherwise():
    key = "mission.explorer.following.navigation"
    paper = ("--preset", "paper")
    assert campaign(*paper).settings == ((key, "visibility"),)
    assert campaign(*paper, "--set", f"{GATE}=0.9").settings == ((key, "visibility"), (GATE, 0.9))
    assert campaign(*paper, "--set", f"{key}=floor").settings == ()
    assert campaign(*paper, "--navigation", "floor").settings == ()


def test_navigation_is_a_setting_of_runs_and_campaigns(run, tmp_path, capsys):
    key, words = "mission.explorer.following.navigation", ("--navigation", "visibility")
    out = tmp_path / "walls"
    assert main(["explore", "paper-fig4", "--max-steps", "2", *words, "--out", str(out)]) == 0
    assert read_trial(out / "config.json").mission.explorer.following.navigation == "visibility"
    assert " --navigation visibility " in run_page(out).command
    assert read_trial(run / "config.json").mission.explorer.following.navigation == "floor"
    assert campaign(*words).settings == campaign("--set", f"{key}=visibility").settings == ((key, "visibility"),)
    assert campaign(*words, "--set", f"{GATE}=0.9").settings == ((key, "visibility"), (GATE, 0.9))
    assert campaign("--set", f"{key}=visibility", "--navigation", "floor").settings == ()
    capsys.readouterr()
    assert main(["explore", "paper-fig4", "--set", f"{key}=stars", "--out", str(tmp_path / "none")]) == 2
    assert len(capsys.readouterr().err.splitlines()) == 1


def test_a_group_that_may_be_none_is_switched_off_and_stays_so():
    settled = campaign("--set", "mission.mapper.merging=null", "--set", f"{GATE}=0.9")
    trial = config_of(settled, Trial("paper-fig8", "nearest-robot", "graph", CLOSED, 1))
    assert trial.mission.mapper.merging is None
    assert gate_of(settled) == trial.mission.mapper.matching.gate == 0.9
    assert gate_of(campaign()) == 0.99
    # The command that a report names makes the same campaign.
    assert _parse(shlex.split(command_of(settled))[1:])[0].campaign == settled


def test_double_entries_are_held_against_the_gate_of_the_campaign():
    counts = {"matches_true": 90, "matches_missed": 10, "matches_false": 0, "duplicate_lines": 12}
    counts |= {"merges": 0, "false_merges": 0}
    assert doubles(counts, 0.9)["doubles_beyond_gate"] == pytest.approx(2.0)
    assert doubles(counts)["doubles_beyond_gate"] == pytest.approx(11.0)


@pytest.mark.parametrize("key", ["world", "backend", "strategy", "seed", "errorless", "start"])
def test_what_a_campaign_settles_itself_cannot_be_set(key, capsys):
    value = {"seed": 1, "errorless": "true", "start": "[1, 2]"}.get(key, "hall")
    assert main(["compare", "--preset", "smoke", "--out", "DIR", "--set", f"{key}={value}"]) == 2
    assert "the command's own options" in capsys.readouterr().err


def test_campaigns_of_other_settings_are_neither_one_nor_the_same(tmp_path, capsys):
    words = ["compare", "--worlds", "paper-fig4", "--backends", "full-ekf", "--strategies", "nearest-robot", "--trials"]
    words += ["1", "--max-steps", "3", "--modes", "closed", "--jobs", "1", "--out"]
    one, two = str(tmp_path / "one"), str(tmp_path / "two")
    assert main([*words, one]) == main([*words, two, "--set", f"{GATE}=0.9", "--first-seed", "1"]) == 0
    capsys.readouterr()
    assert main([*words, two]) == 2
    assert "other settings" in capsys.readouterr().err
    assert main(["compare", "--merge", one, two, "--out", str(tmp_path / "both")]) == 2
    assert "one settings" in capsys.readouterr().err
    assert main(["compare", "--against", one, two, "--out", str(tmp_path / "against")]) == 0
    said = json.loads((tmp_path / "against" / "contrast.json").read_text())
    assert said["settings"] == {GATE: [0.99, 0.9]}


def test_a_replay_has_the_settings_of_its_run_until_others_are_asked_for(run, tmp_path):
    def replayed(name, *words):
        out = tmp_path / name
        assert main(["replay", str(run / "log.npz"), "--out", str(out), *words]) == 0
        return read_trial(out / "config.json")

    path = tmp_path / "other.json"
    other = replace(read_trial(run / "config.json"), seed=9, world="hall", max_steps=1)
    path.write_bytes(json_bytes(config_record(other)).replace(b'"gate": 0.9,', b'"gate": 0.95,', 1))
    plain = replayed("plain")
    assert plain.mission.mapper.matching.gate == 0.9
    changed = replayed("changed", "--config", str(path))
    assert changed.mission.mapper.matching.gate == 0.95
    assert (changed.seed, changed.world, changed.max_steps) == (1, "paper-fig4", 3)
    mine = replayed("mine", "--config", str(path), "--set", f"{GATE}=0.8", "--set", "backend_options.ekf.at_wall=false")
    assert (mine.mission.mapper.matching.gate, mine.backend_options.ekf.at_wall) == (0.8, False)
    page = _parse(shlex.split(run_page(tmp_path / "mine").command)[1:])[0]
    assert asked(page.config, parse_settings(page.set), ()) == {
        "mission": {"mapper": {"matching": {"gate": 0.8}}}, "backend_options": {"ekf": {"at_wall": False}},
    }  # fmt: skip


@pytest.mark.parametrize("pair", ["seed=2", "robot.radius_m=0.3", "world=hall"])
def test_what_a_log_has_settled_cannot_be_set(pair, run, tmp_path, capsys):
    assert main(["replay", str(run / "log.npz"), "--out", str(tmp_path / "out"), "--set", pair]) == 2
    assert "the command's own options" in capsys.readouterr().err
    assert not (tmp_path / "out").exists()


@pytest.mark.parametrize("more", [["--seed", "1"], ["--set", f"{GATE}=0.9"], ["--config", "x.json"]], ids=" ".join)
def test_a_saved_run_goes_on_with_its_own_settings(run, more, capsys):
    assert main(["explore", "--resume", str(run), *more]) == 2
    assert "the saved run decides it" in capsys.readouterr().err


def test_the_command_on_the_page_of_a_run_names_its_settings(run):
    trial = read_trial(run / "config.json")
    assert _parse(shlex.split(run_page(run).command)[1:])[0].trial == trial
