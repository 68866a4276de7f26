"""Both followings: which runs the study makes, what a row holds, and what the tables say of the rows."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.following.behaviour import Behaviour
from studies.paper import following, following_tables
from studies.paper.following import BY_BACKEND, BY_METHOD, FollowingStudy, trial
from studies.paper.following_tables import costs, figures


def row(**changes):
    plain = {
        "part": BY_METHOD, "figure": "fig8", "following": "paper", "strategy": "nearest-robot", "backend": "block-ekf",
        "errorless": False, "seed": 1, "status": "complete", "steps": 100, "path_length_m": 20.0, "contours_closed": 2,
        "contours_reachable": 2, "coverage": 1.0, "collisions": 0, "pose_anees": 1.0, "map_anees": 1.0,
        "duplicate_lines": 0, "first_closed_m": 10.0, "longest_route": 2, "start_passes": 1,
        "behaviours": {"approach": 10, "follow": 20, "reverse": 5},
    }  # fmt: skip
    return plain | changes


def rows_of(cost):
    """Rows of every task of two seeds; `cost` gives the ANEES of block-ekf by following, over that of full-ekf."""
    names = following.NAMES
    found = []
    for task in FollowingStudy(seeds=6).tasks():
        named = dict(zip(names, task, strict=True))
        rng = np.random.default_rng(len(found))
        own = {"path_length_m": 60.0 if named["figure"] == "fig6" else 20.0}
        if named["part"] == BY_BACKEND:
            base = np.exp(rng.normal(0.0, 0.05))
            factor = cost[named["following"]] if named["backend"] == "block-ekf" else 1.0
            own |= {"pose_anees": base * factor, "map_anees": base * factor}
        found.append(row(**named, **own))
    return found


def test_each_run_is_that_of_the_preset_or_of_todays_mapper_driven_by_it():
    tasks = FollowingStudy(seeds=2).tasks()
    assert len(set(tasks)) == len(tasks)
    for task in tasks:
        made = trial(task, 100)
        mission = made.mission
        assert mission.explorer.following.method == task[2]
        assert mission.explorer.following.navigation == "visibility"
        assert mission.explorer.sweep is False
        assert (mission.mapper.matching.method == "paper") == (task[0] == BY_METHOD)
        assert (made.strategy, made.backend, made.errorless, made.seed) == task[3:]


def test_a_row_tells_what_the_steps_were_spent_on():
    task = (BY_METHOD, "fig4", "paper", "nearest-robot", "block-ekf", True, 1)
    (made,) = following._one(40, task)
    assert sum(made["behaviours"].values()) == made["steps"] == 40
    assert set(made["behaviours"]) <= {word.value for word in Behaviour}
    assert made["longest_route"] >= 1
    assert made["collisions"] == 0


@pytest.mark.parametrize(("paper", "differs"), [(30.0, True), (10.0, False)])
def test_the_cost_of_the_shortcut_is_that_of_the_rows(paper, differs):
    _, table = costs(rows_of({"paper": paper, "viewpoints": 10.0})).values()
    assert [line[0] for line in table[1:]] == ["pose ANEES", "map ANEES"]
    for _, own, _, ratio in table[1:]:
        assert float(own.split()[0]) == pytest.approx(paper, rel=0.1)
        low, high = map(float, ratio.split("(")[1].rstrip(")").split(" to "))
        assert not low <= 1.0 <= high if differs else low <= 1.0 <= high


def test_the_interval_of_a_comparison_is_wider_since_two_scores_are_compared():
    logs = np.log([1.0, 2.0, 3.0, 4.0, 5.0])
    widths = [
        float(high) / float(low)
        for level in (0.95, 0.975)
        for low, high in [following_tables._interval(logs, level).split("(")[1].rstrip(")").split(" to ")]
    ]
    assert widths[0] < widths[1]


def test_the_factor_between_the_strategies_is_that_of_the_rows():
    assert figures(rows_of({"paper": 1.0, "viewpoints": 1.0}))[-1][-2:] == ["3; 3", "3; 3"]


def test_seeds_may_begin_anywhere():
    assert replace(FollowingStudy(), first_seed=31, seeds=1).tasks()[-1][-1] == 31
