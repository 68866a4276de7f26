"""Settings by name: every one of a trial comes back from a file and is reached by --set, and whatever else is told."""

import json
import os

import pytest

from chainslam.experiments.artifacts.files import json_bytes
from chainslam.experiments.artifacts.results import config_record
from chainslam.experiments.artifacts.saved import read_trial
from chainslam.experiments.artifacts.settings import (
    defaults,
    leaves,
    nested,
    parse_setting,
    read_settings,
    record_of,
    trial_of,
)
from chainslam.experiments.commands.campaigns.compare import Compare
from chainslam.experiments.commands.cli import main
from chainslam.experiments.commands.explore import Explore
from chainslam.experiments.scenario import TrialConfig
from chainslam.experiments.usage import UsageError
from chainslam.sim.logs.recorded_robot import FORMAT

LEAVES = dict(leaves(defaults()))


def another(value):
    """A value of the same type that is not this one."""
    if isinstance(value, bool):
        return not value
    if isinstance(value, list):
        return [another(each) for each in value]
    if isinstance(value, str):
        return {
            "small": "large",
            "floor": "visibility",
            "joint": "paper",
            "wheels": "scans",
            "viewpoints": "paper",
        }.get(value, value + "x")
    if isinstance(value, int):
        return value + 1 if value < 2**30 else value - 1
    return 0.9 * value if value else 0.5


FENCE = [[0.0, 0.0], [4.0, 0.0], [4.0, 3.0]]
PLACES = ("start", "mission.free_space.fence", "robot.outline_m")
"""Settings that are no number of their own."""
NAMED = {
    "mission.free_space.fence": FENCE,
    "robot.outline_m": [[0.2, 0.1], [-0.2, 0.1], [-0.2, -0.1], [0.2, -0.1]],
    "backend_options.own": {"MyConfig": {"gain": 0.5}},
    "map": "results/first",
    "drawing.level": "1",
    "drawing.threshold": 0.5,
    "robot.faults.people.standing": [1.0, 2.0],
    **{f"drawing.{name}": ["walls", "doors"] for name in ("layers", "ids", "without")},
}
"""Settings whose default does not say what they hold."""


def test_every_setting_stands_in_the_config_and_is_reached_by_its_key():
    assert len(LEAVES) > 150
    for key, value in LEAVES.items():
        if key in ("start", "backend_options.own"):
            continue
        new = NAMED.get(key, another(value))
        words = f"{key}={json.dumps(new)}"
        changed = dict(leaves(record_of(trial_of(parse_setting(words)))))
        with_it = {"robot.radius_m"} if key == "robot.outline_m" else set()
        assert {name for name in changed if changed[name] != LEAVES.get(name)} == {key} | with_it
        assert changed[key] == new


def test_a_config_comes_back_with_every_setting_changed(tmp_path):
    changed = trial_of(
        nested((key, NAMED.get(key, another(value))) for key, value in LEAVES.items() if key not in PLACES)
    )
    assert changed != TrialConfig("")
    path = tmp_path / "config.json"
    path.write_bytes(json_bytes(config_record(changed)))
    assert read_trial(path) == changed
    assert trial_of(read_settings(path)) == changed
    path.write_bytes(json_bytes({"mission": {"mapper": {"matching": {"gate": 0.9}}}}))
    assert trial_of(read_settings(path)) == trial_of(parse_setting("mission.mapper.matching.gate=0.9"))


def test_an_option_wins_over_set_and_set_over_config(tmp_path):
    path = tmp_path / "mine.json"
    path.write_text(json.dumps({"world": "hall", "seed": 5, "backend": "block-ekf", "max_steps": 7, "p0": "large"}))
    asked = Explore(config=path, set=("seed=6", "backend=full-ekf"), backend="fej-ekf")
    assert (asked.trial.world, asked.trial.seed, asked.trial.backend) == ("hall", 6, "fej-ekf")
    assert (asked.trial.max_steps, asked.trial.p0) == (7, "large")
    # Named on the command line with the value that it has anyway.
    assert Explore(config=path, given=frozenset({"backend", "seed"})).trial.backend == "graph"
    assert Explore(config=path, sweep=False).trial.mission.explorer.sweep is False


def test_what_a_command_names_counts_though_it_is_the_default(tmp_path):
    path, out = tmp_path / "mine.json", tmp_path / "run"
    said = {"world": "paper-fig4", "seed": 5, "errorless": True, "mission": {"return_to_start": True}}
    path.write_text(json.dumps(said))
    words = ["explore", "--config", str(path), "--max-steps", "2", "--seed", "1", "--no-errorless", "--out", str(out)]
    assert main([*words, "--set", "mission.mapper.matching.gate=0.95"]) == 0
    trial = read_trial(out / "config.json")
    assert (trial.seed, trial.errorless, trial.max_steps, trial.mission.mapper.matching.gate) == (1, False, 2, 0.95)
    again = tmp_path / "again"
    assert main(["explore", "--config", str(out / "config.json"), "--out", str(again)]) == 0
    assert (again / "log.npz").read_bytes() == (out / "log.npz").read_bytes()


BAD = {
    "no equals sign": ("mission", "--set KEY=VALUE"),
    "no key": ("=3", "--set KEY=VALUE"),
    "an unknown key": ("mission.mapper.matching.gat=1", "is it mission.mapper.matching.gate"),
    "a group": ("mission.mapper=3", "should be an object"),
    "an empty group": ("mission.mapper={}", "nothing in mission.mapper"),
    "below a value": ("seed.x=3", "an object where seed should be a whole number"),
    "text for a number": ("seed=many", "a whole number"),
    "a fraction for a count": ("seed=1.5", "a whole number"),
    "none for a number": ("seed=null", "should be"),
    "text for a truth": ("errorless=yes", "true or false"),
    "an unknown word": ("p0=huge", "one of"),
    "no number": ("scale=NaN", "the number NaN"),
    "a number without end": ("scale=1e999", "the number Infinity"),
    "many digits": (f"seed={'9' * 5000}", "truncated JSON"),
    "broken JSON": ("start=[1,", "truncated JSON"),
    "deep JSON": ("start=" + "[" * 5000 + "]" * 5000, "truncated JSON"),
    "a key that moves the cursor": ("\x1b[2J=1", "unknown key"),
}


@pytest.mark.parametrize("case", BAD)
def test_a_setting_that_is_none_is_told_in_one_line(case, capsys, tmp_path):
    words, told = BAD[case]
    assert main(["explore", "paper-fig4", "--out", str(tmp_path / "run"), f"--set={words}"]) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert told in err
    assert "\x1b" not in err
    assert not (tmp_path / "run").exists()


FILES = {
    "a list": b"[1]",
    "no JSON": b"gate: 3",
    "a key twice": b'{"seed": 1, "seed": 2}',
    "an unknown key": b'{"mission": {"maper": {}}}',
    "another type": b'{"mission": {"max_steps": "many"}}',
    "another format": b'{"format": 99, "trial": {}}',
    "no format": b'{"trial": {}}',
    "a missing key": b'{"format": %d, "trial": {"world": "hall"}}' % FORMAT,
    "no number": b'{"drawing": {"scale": NaN}}',
}


@pytest.mark.parametrize("case", FILES)
def test_a_file_without_settings_is_told_in_one_line(case, capsys, tmp_path):
    path = tmp_path / "mine.json"
    path.write_bytes(FILES[case])
    for command in (["explore", "hall"], ["compare", "--preset", "smoke"]):
        assert main([*command, "--out", str(tmp_path / "run"), "--config", str(path)]) == 2
        out, err = capsys.readouterr()
        assert (out, err.count("\n")) == ("", 1)
        assert "mine.json" in err
    assert not (tmp_path / "run").exists()


def test_a_folder_and_a_pipe_are_no_files_of_settings(capsys, tmp_path):
    os.mkfifo(tmp_path / "pipe")
    for path in (tmp_path, tmp_path / "pipe", tmp_path / "none"):
        assert main(["explore", "hall", "--config", str(path)]) == 2
        assert capsys.readouterr().err.count("\n") == 1


def test_the_settings_of_a_campaign_are_those_that_differ_from_the_defaults(tmp_path):
    path = tmp_path / "mine.json"
    path.write_bytes(json_bytes(config_record(trial_of(parse_setting("robot.radius_m=0.25"), {"world": "hall"}))))
    words = ("mission.mapper.matching.gate=0.95", f"mission.explorer.again={LEAVES['mission.explorer.again']}")
    campaign = Compare(tmp_path, "smoke", config=path, set=words).campaign
    assert campaign.settings == (("mission.mapper.matching.gate", 0.95), ("robot.radius_m", 0.25))
    with pytest.raises(UsageError, match=r"--set .*'seed'"):
        _ = Compare(tmp_path, "smoke", set=("seed=4",)).campaign
