"""Switches in the source, and what is made of runs with rules off."""

import builtins
import json
from pathlib import Path

import numpy as np
import pytest

from studies.rules.held import NEAR
from studies.rules.report import read_lines, tables
from studies.rules.switches import STATE, Switch, fitting, is_kernel, put_in, same
from studies.rules.table import SWITCHES, WHAT
from studies.rules.verdicts import is_clearly_worse, worse

SOURCE = "def doubled(x):\n    y = 2 * x\n    return y if y > limit else 0\nlimit = 4\n"
CAP = Switch("cap", "somewhere", "if «y > limit» else", "True", "small ones are none")
DOUBLE = Switch("double", "somewhere", "y = «2 * x»", "on() // 2", "twice")
TRIPLE = Switch("triple", "somewhere", "y = «2 * x»", "3 * x", "twice, not thrice")


@pytest.fixture
def doubled(monkeypatch):
    """Return the function of the source with its switches in it."""
    monkeypatch.setattr(builtins, "rule_switch", STATE.value, raising=False)
    names: dict[str, object] = {}
    exec(put_in(SOURCE, [CAP, DOUBLE, TRIPLE]), names)
    yield names["doubled"]
    STATE.off, STATE.watch = frozenset(), None


@pytest.mark.parametrize(("off", "of_2", "of_3"), [("", 0, 6), ("cap", 4, 6), ("double", 0, 0), ("triple", 6, 9)])
def test_a_rule_has_its_own_value_and_another_where_it_is_off(doubled, off, of_2, of_3):
    STATE.off = frozenset({off})
    assert (doubled(2), doubled(3)) == (of_2, of_3)


def test_a_watcher_is_told_of_rules_that_would_change_something_and_may_turn_one_off(doubled):
    told = []
    STATE.watch = lambda rule: told.append(rule) or rule == "triple"
    assert doubled(0) == 0
    assert told == ["cap"]
    assert doubled(3) == 9
    assert told[1:] == ["double", "triple"]


def test_a_rule_that_is_not_there_exactly_once_is_refused():
    for source in ("y = 2", SOURCE + SOURCE):
        with pytest.raises(ValueError, match="expected the rule cap once"):
            put_in(source, [CAP])


def test_every_rule_is_where_the_table_says(capsys):
    assert fitting(SWITCHES) == list(SWITCHES), capsys.readouterr().err
    assert len({switch.name for switch in SWITCHES}) == len(WHAT)
    assert all(WHAT.values())


def test_the_tests_that_are_about_a_rule_are_there():
    stems = {path.stem.removeprefix("test_") for path in Path("tests").rglob("test_*.py")}
    for module in {switch.module.rpartition(".")[2] for switch in SWITCHES}:
        assert set(NEAR[module].split()) <= stems, module


def test_a_rule_in_a_compiled_loop_is_told_from_one_that_python_runs():
    kernels = {switch.name for switch in SWITCHES if is_kernel(switch)}
    assert "reliability.noise" in kernels
    assert "loop_search.two" not in kernels


def test_two_values_are_the_same_where_all_that_they_hold_is():
    assert same((np.zeros(2), CAP), (np.zeros(2), CAP))
    assert not same((np.zeros(2), CAP), (np.zeros(2), DOUBLE))
    assert not same(np.zeros(2), np.zeros(3))
    assert not same(None, CAP)


def test_every_test_that_is_said_to_hold_a_rule_is_there():
    for line in Path("studies/rules/held.jsonl").read_text().splitlines():
        file, _, name = json.loads(line)["held_by"].partition("::")
        assert f"def {name.partition('[')[0]}(" in Path(file).read_text(), name


def test_the_page_shows_what_was_stored():
    held = {each["rule"]: each["held_by"] for each in read_lines(Path("studies/rules/held.jsonl"))}
    assert tables(held, read_lines(Path("studies/rules/rows.jsonl"))) in Path("docs/contributing/rules.md").read_text()


def row(rule, plan, **changes):
    found = {"code": "a", "status": "complete", "reason": "", "steps": 100, "coverage_own_frame": 0.99} | changes
    figures = dict.fromkeys(["contours_closed", "map_anees", "pose_anees", "duplicate_lines", "false_matches"], 1)
    return figures | {"rule": rule, "plan": plan, "collisions": 0, "false_merges": 0, "fires": {"cap": 1}} | found


def runs(**changes):
    """Return six plans with all rules, and without one, where some figures differ."""
    return [row(rule, k, **(changes if rule else {})) for k in range(6) for rule in ("", "cap")]


def test_without_a_rule_nothing_is_worse_where_nothing_is():
    assert worse(runs(), "cap") == []
    assert worse(runs(coverage_own_frame=1.0, false_matches=0, steps=80), "cap") == []
    assert worse(runs(code="b", false_matches=9), "cap") == []  # other code: nothing to hold them against


def test_figures_that_are_worse_in_every_plan_are_told_with_how_sure_that_is():
    rows = runs(false_matches=3)
    for k, each in enumerate(rows[1::2]):
        each["false_matches"] += k % 2
    (found,) = worse(rows, "cap")
    more = np.array([2.0, 3.0] * 3)
    assert found.what == "false matches 6 to 21"
    assert found.sigmas == pytest.approx(more.mean() / (more.std(ddof=1) / np.sqrt(6)))
    assert is_clearly_worse(rows, "cap")


@pytest.mark.parametrize(
    ("changes", "words"),
    [
        ({"status": "stopped", "reason": "the limit"}, "5 stopped: the limit"),
        ({"collisions": 2}, "5: 2 collisions"),
        ({"coverage_own_frame": 0.5}, "5: coverage 0.990 to 0.500"),
    ],
)
def test_one_run_that_ends_worse_is_told_and_two_end_the_study(changes, words):
    rows = runs()
    rows[-1] |= changes
    assert [each.what for each in worse(rows, "cap") if np.isinf(each.sigmas)] == [words]
    assert not is_clearly_worse(rows, "cap")
    rows[-3] |= changes
    assert is_clearly_worse(rows, "cap")


def test_the_table_says_what_holds_a_rule_and_what_got_worse_without_it():
    name = "matching.beside"
    rows = json.loads(json.dumps(runs(false_matches=3)).replace('"cap"', f'"{name}"'))
    made = tables({name: "tests/slam/association/test_gate.py::test_short[a]"}, rows)
    (line,) = (line for line in made.splitlines() if line.startswith(f"| `{name}`"))
    assert line.endswith("| 6 of 6 plans | worse: false matches 6 to 18 (99.0 sigmas); fails `test_short` |")
