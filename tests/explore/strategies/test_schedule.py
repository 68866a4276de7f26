"""Strategies one after another, as the command line names them."""

import numpy as np
import pytest

from chainslam.explore.strategies import STRATEGIES, make_strategy


@pytest.mark.parametrize("name", list(STRATEGIES))
def test_a_name_alone_is_the_strategy_itself(name):
    assert type(make_strategy(name)) is type(STRATEGIES[name].make())


def test_a_schedule_changes_at_its_steps(scene_of):
    scene = scene_of(1)
    pose = np.append(scene.places[0], 0.0)
    strategy = make_strategy("nearest-robot,nearest-start@200,same-chain@500")
    words = [
        strategy.choose(scene.situation(pose, [(0, 1), (3,)], step=step)).reason for step in (0, 199, 200, 499, 500)
    ]
    assert words[0] == words[1]
    assert words[2] == words[3]
    assert "nearest to the start" in words[2]
    assert "no chain was begun" in words[4]


@pytest.mark.parametrize(
    "words",
    ["", "magic", "nearest-robot,magic@3", "nearest-robot,same-chain", "nearest-robot@5", "nearest-robot,same-chain@x",
     "nearest-robot,same-chain@5,frontier@5", "nearest-robot,same-chain@-3", "nearest-robot,"],
)  # fmt: skip
def test_anything_else_is_refused_in_one_line(words):
    with pytest.raises(ValueError, match=r"^expected .*, found .*: [^\n]*$"):
        make_strategy(words)
