"""Where something moved, what was given up is tried again, and `complete` is not said of what is still in the way."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.goals import second_tries as module
from chainslam.explore.outcome import Outcome
from chainslam.slam.robot import Scan
from tests.explore.goals.scripted import NO_SWEEP, ask, ends_at, explorer_at

pytestmark = pytest.mark.usefixtures("_unchecked")


@pytest.fixture
def moving(monkeypatch):
    """Say what moves at each step: something, as long as the list has an entry."""
    seen = []

    def found(*_):
        return np.zeros((3, 2)) if seen and seen.pop(0) else np.zeros((0, 2))

    monkeypatch.setattr(module, "moving_returns", found)
    return seen


def at_time(scene, seconds):
    """The scene with a clock: each scan takes so long."""

    def clocked(around):
        clocked.time_s += seconds
        bare = around.scan
        return replace(around, scan=Scan(bare.bearings_rad, bare.ranges_m, 0.01, 4.0, clocked.time_s))

    clocked.time_s = 0.0
    return clocked


def run(explorer, scene, ends, monkeypatch, seconds=1.0, most=400):
    """Ask until there is nothing left to do; return all decisions."""
    from tests.explore.goals import scripted

    clocked, plain = at_time(scene, seconds), scripted.around_of
    monkeypatch.setattr(scripted, "around_of", lambda scene: clocked(plain(scene)))
    found = []
    for _ in range(most):
        found.append(ask(explorer, scene, ends))
        if found[-1].command is None:
            return found
    raise AssertionError("there is no end")


def test_ends_are_tried_again_and_then_left_as_blocked(scripted, scene, moving, monkeypatch):
    kinds, made = scripted
    kinds["EndErrand"].steps = NO_SWEEP.moving_scans
    moving += [True] * NO_SWEEP.moving_scans
    decisions = run(explorer_at(scene), scene, ends_at((1, 2)), monkeypatch)
    tries = sum(type(errand).__name__ == "EndErrand" for errand in made)
    assert tries >= 1 + NO_SWEEP.again
    assert decisions[-1].outcome is Outcome.ENDS_LEFT
    assert decisions[-1].outcome.status == "stopped"
    assert decisions[-1].words.startswith("ends-left: 1 open ends")


def test_the_robot_waits_the_stated_time_before_it_tries_again(scripted, scene, moving, monkeypatch):
    scripted[0]["EndErrand"].steps = NO_SWEEP.moving_scans
    taken = []
    for wait_s in (2.0, 20.0):
        moving[:] = [True] * NO_SWEEP.moving_scans
        explorer = explorer_at(scene, config=replace(NO_SWEEP, wait_s=wait_s))
        taken.append(len(run(explorer, scene, ends_at((1, 2)), monkeypatch)))
    waited = taken[1] - taken[0]
    assert waited == pytest.approx(NO_SWEEP.again * 18.0, abs=NO_SWEEP.again)


def test_an_end_that_can_be_seen_at_the_second_try_is_no_longer_left(scripted, scene, moving, monkeypatch):
    """The end is gone once it was tried again: all chains are closed, and that is said."""
    moving += [True] * NO_SWEEP.moving_scans
    explorer, ends = explorer_at(scene), ends_at((1, 2))
    for _ in range(NO_SWEEP.moving_scans + 1):
        ask(explorer, scene, ends)
    decisions = run(explorer, scene, [], monkeypatch)
    assert decisions[-1].outcome is Outcome.ALL_CLOSED


@pytest.mark.parametrize("scans", [0, NO_SWEEP.moving_scans - 1])
def test_where_hardly_anything_moved_nothing_is_tried_again(scripted, scene, moving, monkeypatch, scans):
    _, made = scripted
    moving += [True] * scans
    decisions = run(explorer_at(scene), scene, ends_at((1, 2)), monkeypatch)
    assert decisions[-1].outcome is Outcome.NONE_REACHABLE
    assert sum(type(errand).__name__ == "EndErrand" for errand in made) <= 2


def test_unseen_floor_that_something_is_in_the_way_of_is_left_too(scripted, scene_of, moving, monkeypatch):
    scripted[0]["PlaceErrand"].steps = NO_SWEEP.moving_scans
    moving += [True] * NO_SWEEP.moving_scans
    scene = scene_of(3, looks=1)
    decisions = run(explorer_at(scene, config=replace(NO_SWEEP, sweep=True)), scene, [], monkeypatch)
    assert decisions[-1].outcome is Outcome.ENDS_LEFT
    assert decisions[-1].words.startswith("ends-left: 0 open ends")
