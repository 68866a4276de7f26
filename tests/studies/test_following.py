"""Both followings: which runs the study makes, what a row holds, and that the page's words are those of the rows."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.following.behaviour import Behaviour
from studies.paper import following
from studies.paper.following import BY_BACKEND, BY_METHOD, FollowingStudy, trial
from studies.paper.following_tables import following_section, strategies_in_words


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


@pytest.mark.parametrize(("paper", "verdict"), [(30.0, "changes"), (10.0, "is not shown to change")])
def test_the_answer_is_that_of_the_rows(paper, verdict):
    rows = rows_of({"paper": paper, "viewpoints": 10.0})
    words = following_section(rows)[-2]
    assert words.count(f"so the following {verdict} what it costs") == 2
    told = float(words.partition("multiplies the pose ANEES by ")[2].split()[0])
    assert told == pytest.approx(paper, rel=0.1)


def test_the_factor_between_the_strategies_is_that_of_the_rows():
    rows = rows_of({"paper": 1.0, "viewpoints": 1.0})
    lines = following_section(rows)
    assert next(line for line in lines if line.startswith("| fig6 / fig5")).endswith("| 3; 3 | 3; 3 |")
    assert "20.0 m by the strategy of figure 5 and 60.0 m by that of figure 6, 3.00 times" in strategies_in_words(rows)
    assert strategies_in_words([]) == ""


def test_a_table_without_rows_is_none():
    assert following_section([]) == []
    assert replace(FollowingStudy(), first_seed=31, seeds=1).tasks()[-1][-1] == 31
