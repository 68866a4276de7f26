"""How often the paper's method enters a duplicate wall: what is compared, and how a table counts it."""

from dataclasses import replace

import pytest

from chainslam.experiments.artifacts.settings import trial_of
from studies.consistency.paper_method import KEPT, METHODS, table

PAPER = trial_of(METHODS["paper-method"])


def with_gate(trial, gate):
    mapper = trial.mission.mapper
    mapper = replace(mapper, matching=replace(mapper.matching, gate=gate))
    return replace(trial, mission=replace(trial.mission, mapper=mapper))


@pytest.mark.parametrize(
    ("name", "trial"),
    [
        ("paper-method, full-ekf", replace(PAPER, backend="full-ekf")),
        ("paper-method, gate 0.9999", with_gate(PAPER, 0.9999)),
        ("paper-method, full-ekf, gate 0.9999", with_gate(replace(PAPER, backend="full-ekf"), 0.9999)),
    ],
)
def test_a_variant_of_the_papers_method_differs_in_what_its_name_says_alone(name, trial):
    assert PAPER.backend == "block-ekf"
    assert PAPER.mission.mapper.matching.gate == 0.99
    assert trial_of(METHODS[name]) == trial


def test_runs_with_a_duplicate_wall_are_counted_by_method():
    row = dict.fromkeys(KEPT, 1.0) | {"status": "stopped", "method": "a"}
    shown = table([row | {"duplicate_lines": 2}, row | {"duplicate_lines": 0}, row | {"method": "b"}])
    assert [list(column.cells) for column in shown.columns[:5]] == [
        ["a", "b"], ["2", "1"], ["0", "0"], ["1", "1"], ["1 (0 to 2)", "1 (1 to 1)"],
    ]  # fmt: skip
