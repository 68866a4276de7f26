"""Whatever no setting can have ends in one line and status 2, by --set, --config, a robot's YAML and Python alike.

The cases are made from the schema: every setting, and every value beside what it allows.
"""

import json
import math
from dataclasses import replace
from functools import reduce

import numpy as np
import pytest

import chainslam
from chainslam.experiments.artifacts.presets import robot_of
from chainslam.experiments.artifacts.schema import part_of, resolved
from chainslam.experiments.artifacts.settings import defaults, leaves, nested, parse_setting, read_settings
from chainslam.experiments.commands.cli import main
from chainslam.experiments.scenario import TrialConfig, check
from chainslam.experiments.usage import UsageError
from chainslam.experiments.views.settings_schema import config_schema
from chainslam.slam.geometry.quantities import fault
from chainslam.slam.robot import RobotError

LEAVES = dict(leaves(defaults()))
WHOLE = config_schema()
HALL = TrialConfig("hall")
TOLD_LATER = ("seed",)
"""Settings whose upper end a schema's numbers cannot hold; `check` tells it."""


def schema_of(key):
    """What the schema says of a dotted key of a trial."""
    said = WHOLE["properties"]["trial"]
    for step in key.split("."):
        said = part_of(WHOLE, resolved(WHOLE, said), step)
    return said


def numbers_in(said):
    """The parts of a schema that are numbers, each with what makes a value of the whole out of one for it."""
    if said.get("type") in ("number", "integer"):
        yield said, lambda value: value
    for each in said.get("anyOf", ()):
        yield from numbers_in(each)
    if said.get("type") == "array":
        inner = said["items"] or said["prefixItems"][0]
        count = said.get("minItems", 1)
        for each, make in numbers_in(inner):
            yield each, lambda value, make=make: [make(value)] * count


def beyond(said):
    """Numbers right beside what a number's part of a schema allows."""
    apart = 1 if said["type"] == "integer" else 1e-9
    if "minimum" in said:
        yield said["minimum"] - max(apart, abs(said["minimum"]) * 1e-9)
    if "exclusiveMinimum" in said:
        yield said["exclusiveMinimum"]
    if "maximum" in said:
        yield said["maximum"] + max(apart, said["maximum"] * 1e-9)
    if "exclusiveMaximum" in said:
        yield said["exclusiveMaximum"]


def wrong_values(key):
    """Values that a setting cannot have: out of its range, NaN, infinite, of another type."""
    said = schema_of(key)
    for part, make in numbers_in(said):
        for number in (*beyond(part), math.nan, math.inf, *(["many"] if said.get("type") == "array" else [])):
            yield make(number)
    options = said.get("anyOf", [said])
    kinds = {each.get("type") for each in options}
    yield {"x": 1}
    if "string" not in kinds and not any("enum" in each for each in options):
        yield "many"
    if "boolean" not in kinds:
        yield True
    if "string" in kinds or any("enum" in each for each in options):
        yield 3.5
    if "null" not in kinds:
        yield None


CASES = [(key, value) for key in LEAVES for value in wrong_values(key)]


def told(do):
    """The one line in which something ends."""
    with pytest.raises(UsageError) as caught:
        do()
    assert caught.value.exit_status == 2
    words = str(caught.value)
    assert "\n" not in words
    assert words.startswith("expected ")
    assert ", found " in words
    return words


def test_every_number_of_every_setting_has_both_ends_and_a_unit_where_its_name_has_one():
    counted = 0
    for key in LEAVES:
        for said, _ in numbers_in(schema_of(key)):
            counted += 1
            assert "minimum" in said or "exclusiveMinimum" in said, key
            assert key in TOLD_LATER or "maximum" in said or "exclusiveMaximum" in said, key
            for end, unit in (("_m", "m"), ("_rad", "rad"), ("_s", "s"), ("_m_s", "m/s")):
                if key.endswith(end) and not (end != "_m_s" and key.endswith("_m_s")):
                    assert said["unit"] == unit, key
    assert counted > 200
    assert len(CASES) > 1500


def test_by_set_every_value_that_a_setting_cannot_have_is_told():
    for key, value in CASES:
        words = told(lambda key=key, value=value: parse_setting(f"{key}={json.dumps(value)}"))
        # JSON has no such numbers: what no parser takes has no place yet.
        assert key in words or "the number" in words


def test_by_a_file_of_settings_every_value_that_a_setting_cannot_have_is_told(tmp_path):
    path = tmp_path / "mine.json"
    for key, value in CASES:
        path.write_text(json.dumps(nested([(key, value)])))
        assert "mine.json" in told(lambda: read_settings(path))


def test_by_a_robots_file_every_value_that_a_setting_cannot_have_is_told(tmp_path):
    path = tmp_path / "mine.yaml"
    for key, value in CASES:
        if key.startswith("robot."):
            path.write_text(json.dumps(nested([(key.removeprefix("robot."), value)])))
            assert "mine.yaml" in told(lambda: robot_of(str(path)))


def test_from_python_every_value_that_a_setting_cannot_have_is_told():
    for key, value in CASES:
        told(lambda key=key, value=value: chainslam.explore("hall", settings={key: value}))


def test_settings_that_python_made_by_hand_are_checked():
    for key, value in CASES:
        if isinstance(value, float) and isinstance(LEAVES[key], float):
            *groups, name = key.split(".")
            group = reduce(getattr, groups, HALL)
            try:
                found = fault(replace(group, **{name: value}))
            except RobotError as error:  # what a robot states is checked when it is made
                found = str(error)
            assert f"where {name} should be a number" in found


def test_a_trial_made_by_hand_is_checked_before_anything_is_computed():
    matching = replace(HALL.mission.mapper.matching, gate=1.95)
    mapper = replace(HALL.mission.mapper, matching=matching)
    trial = replace(HALL, mission=replace(HALL.mission, mapper=mapper))
    assert "1.95 where mission.mapper.matching.gate should be" in told(lambda: check(trial))
    check(replace(HALL, start=(np.float64(1.0), np.float64(2.0)), max_path_m=np.float64(3.0)))


def test_an_unknown_key_is_told_with_the_one_that_it_may_be(tmp_path):
    path = tmp_path / "mine.json"
    for key in LEAVES:
        assert key in told(lambda key=key: parse_setting(f"{key}x=1"))
        path.write_text(json.dumps(nested([(f"{key}x", 1)])))
        assert f"{key}x" in told(lambda: read_settings(path))
        if key.startswith("robot."):
            path.write_text(json.dumps(nested([(f"{key.removeprefix('robot.')}x", 1)])))
            assert f"{key}x" in told(lambda: robot_of(str(path)))


def without(record, key):
    name, _, inner = key.partition(".")
    return {k: without(v, inner) if k == name else v for k, v in record.items() if k != name or inner}


def test_a_key_that_is_missing_in_a_runs_config_is_told(tmp_path):
    path = tmp_path / "config.json"
    for key in LEAVES:
        path.write_text(json.dumps({"format": 1, "trial": without(defaults(), key)}))
        words = told(lambda: read_settings(path))
        assert f"no trial.{key}" in words or f"nothing in trial.{key.rpartition('.')[0]}" in words


@pytest.mark.parametrize(
    "words",
    [
        "mission.mapper.matching.gate=1.95",
        "mission.mapper.matching.overlap_m=-5",
        "robot.lidar.beams=0",
        "robot.lidar.fov_rad=99",
        "robot.sampling_m=0",
    ],
)
def test_the_command_ends_with_status_2(words, capsys, tmp_path):
    assert main(["explore", "paper-fig4", "--set", words, "--out", str(tmp_path / "run")]) == 2
    out, err = capsys.readouterr()
    assert (out, err.count("\n")) == ("", 1)
    assert words.partition("=")[0] in err
    assert not (tmp_path / "run").exists()
