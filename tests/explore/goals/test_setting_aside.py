"""Which ends the explorer gives up, and where it tries them again; its errands follow a script."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.goals import explorer as explorer_module
from chainslam.explore.goals import second_tries
from chainslam.explore.outcome import Outcome
from chainslam.slam.robot import MotionCommand
from tests.explore.goals.scripted import NO_SWEEP, ask, ends_at, explorer_at


@pytest.mark.parametrize("times", [2, 5])
def test_an_end_that_comes_and_goes_is_set_aside_in_the_end(scripted, scene, times):
    kinds, _ = scripted
    kinds["EndErrand"].steps = 99
    explorer = explorer_at(scene, config=replace(NO_SWEEP, returns=times))
    ends = ends_at((1, 2))
    for _ in range(times):
        assert not ask(explorer, scene, ends).given_up.ends
        ask(explorer, scene, [])
    aside = ask(explorer, scene, ends).given_up.ends
    assert [end.reason for end in aside] == [f"open again after it was gone {times} times"]


@pytest.mark.parametrize(("shift_m", "again"), [(0.19, False), (0.21, True)])
def test_an_end_set_aside_is_tried_again_where_it_has_moved(scripted, scene, shift_m, again):
    kinds, made = scripted
    kinds["EndErrand"].looks_done = 1
    explorer = explorer_at(scene)
    (end,) = ends_at((1, 2))
    ask(explorer, scene, [end])
    ask(explorer, scene, [])
    assert len(made) == 1
    ask(explorer, scene, [replace(end, position_world=end.position_world + np.array([0.0, shift_m]))])
    assert len(made) == 1 + again


@pytest.mark.parametrize(("cells", "again"), [(109, False), (111, True)])
def test_an_end_that_could_not_be_looked_at_is_tried_again_where_the_floor_has_become_known(
    scripted, scene, monkeypatch, cells, again
):
    _, made = scripted
    known = [100]
    for module in (explorer_module, second_tries):
        monkeypatch.setattr(module, "known_floor", lambda *_: known[0])
    explorer = explorer_at(scene)
    ends = ends_at((1, 2))
    ask(explorer, scene, ends)
    tried = len(made)
    ask(explorer, scene, ends)
    assert len(made) == tried
    known[0] = cells
    ask(explorer, scene, ends)
    assert (len(made) > tried) == again


def test_what_lies_beyond_the_fence_is_set_aside_without_a_look(scripted, scene):
    kinds, made = scripted
    kinds["EndErrand"].steps = 99
    fence = ((0.0, 0.0), (3.0, 0.0), (3.0, 6.0), (0.0, 6.0))
    fenced = replace(scene, grid=FreeSpace(FreeSpaceConfig(fence=fence)))
    decision = ask(explorer_at(fenced), fenced, ends_at((5, 2), (2, 2)))
    assert decision.goal.wall == 1
    assert [(end.wall, end.reason) for end in decision.given_up.ends] == [(0, "beyond the fence")]
    assert len(made) == 1


def test_what_lies_on_something_round_is_set_aside_without_a_look(scripted, scene, monkeypatch):
    kinds, made = scripted
    kinds["EndErrand"].steps = 99
    monkeypatch.setattr(explorer_module, "is_round", lambda end, walls, config: end.wall == 0)
    decision = ask(explorer_at(scene), scene, ends_at((5, 2), (2, 2)))
    assert [(end.wall, end.reason) for end in decision.given_up.ends] == [(0, "on a curved obstacle")]
    assert decision.goal.wall == 1
    assert len(made) == 1


@pytest.mark.parametrize("aside", [0, 2])
def test_the_end_says_how_many_ends_cannot_be_closed(scripted, scene, aside):
    kinds, _ = scripted
    kinds["EndErrand"].looks_done = 1
    explorer = explorer_at(scene)
    ends = ends_at((1, 2), (4, 4))[:aside]
    decisions = [ask(explorer, scene, ends) for _ in range(3)]
    # A scan more, since chains may join where ends were given up just now.
    assert [decision.command is None for decision in decisions] == [not aside, True, True]
    if aside:
        assert decisions[0].command == MotionCommand(0.0, NO_SWEEP.robot.turn_rad)
    assert decisions[0].words == ("" if aside else "every chain is closed")
    assert decisions[-1].outcome is (Outcome.NONE_REACHABLE if aside else Outcome.ALL_CLOSED)
    words = "no reachable open end is left; 2 cannot be closed" if aside else "every chain is closed"
    assert decisions[-1].words == words
