"""What the explorer makes of a goal: begun, dropped, walked to; its errands follow a script."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.explore.goals import explorer as module
from chainslam.explore.strategies import Choice, Place
from tests.explore.goals.scripted import NO_SWEEP, ON, First, around_of, ask, ends_at, explorer_at, names


def test_a_goal_is_that_of_the_strategy_with_its_reason_and_the_walls_to_it(scripted, scene):
    kinds, made = scripted
    kinds["EndErrand"].steps = 5
    strategy = First()
    explorer = explorer_at(scene, strategy)
    (end,) = ends_at((1, 2), wall=4)
    decision = ask(explorer, scene, [end])
    assert decision.command is ON
    assert decision.words == "on its way (the first)"
    assert decision.outcome is None
    goal = decision.goal
    assert (goal.kind, goal.wall, goal.side, goal.reason) == ("open-end", 4, 1, "the first")
    np.testing.assert_array_equal(goal.position_world, [1, 2])
    assert made[0].given == (end, FollowingConfig())
    assert decision.walls_to_follow == ()
    made[0].walls_to_follow = (9,)
    assert ask(explorer, scene, [end]).walls_to_follow == (9,)
    assert strategy.situation.step == 0
    assert [chain.walls for chain in strategy.situation.chains] == [(4,)]
    assert [chain.open_ends for chain in strategy.situation.chains] == [(end,)]
    assert strategy.situation.following == FollowingConfig()
    assert not strategy.situation.was_in_vain(np.zeros(2))
    np.testing.assert_array_equal(strategy.situation.start_world, scene.places[0])
    assert len(made) == 1, "one errand for one goal"


@pytest.mark.parametrize("looks", [1, 3])
def test_an_end_that_is_open_after_its_views_is_set_aside_and_the_next_one_is_the_goal(scripted, scene, looks):
    kinds, made = scripted
    kinds["EndErrand"].looks_done = looks
    ends = ends_at((1, 2), (4, 4))
    decision = ask(explorer_at(scene), scene, ends)
    words = f"still open after {looks} view{'s' * (looks > 1)}"
    assert [(end.wall, end.reason) for end in decision.given_up.ends] == [
        (0, words), (1, words),
    ]  # fmt: skip
    assert names(made) == ["EndErrand", "EndErrand"]


def test_a_goal_goes_with_its_end_its_reason_or_its_strategy(scripted, scene):
    kinds, made = scripted
    kinds["EndErrand"].steps = 99
    strategy = First()
    explorer = explorer_at(scene, strategy)
    first, second = ends_at((1, 2), (4, 4))
    ask(explorer, scene, [first, second])
    assert ask(explorer, scene, [second]).goal.wall == 1
    strategy.holding = False
    assert len(made) == 2
    ask(explorer, scene, [second])
    assert len(made) == 3
    strategy.holding = True
    explorer.strategy = First()
    ask(explorer, scene, [second])
    assert len(made) == 4
    ask(explorer, scene, [second])
    assert len(made) == 4


def test_an_errand_hears_where_its_end_is_now_and_what_stands_in_its_way(scripted, scene):
    kinds, made = scripted
    kinds["EndErrand"].steps = 99
    explorer = explorer_at(scene)
    explorer.interrupt(around_of(scene))
    (end,) = ends_at((1, 2))
    ask(explorer, scene, [end])
    moved = replace(end, position_world=np.array([1.1, 2.0]))
    ask(explorer, scene, [moved])
    around = around_of(scene)
    explorer.interrupt(around)
    assert made[0].told == [moved, around]


class Undecided:
    """Knows nowhere to go."""

    def choose(self, situation):
        return None


def test_without_a_choice_the_robot_goes_straight_to_the_nearest_end(scripted, scene):
    kinds, _ = scripted
    kinds["EndErrand"].steps = 99
    here = scene.places[0]
    decision = ask(explorer_at(scene, Undecided()), scene, ends_at(here + 2.0, here + 0.5, here - 1.0))
    assert decision.goal.wall == 1
    assert decision.goal.reason == "no way to stand before any open end is known; nearest"


PLACE = Place(np.array([[1.0, 1.0], [1.0, 2.0]]), "unseen floor")


@pytest.fixture
def swept(monkeypatch):
    """What is left when no open end is: always the same place, until it was visited in vain."""

    def nearest_left(situation, sweep):
        in_vain = situation.was_in_vain(PLACE.centre_world)
        return None if in_vain else Choice(PLACE, "unseen floor is left")

    monkeypatch.setattr(module, "nearest_left", nearest_left)


@pytest.mark.usefixtures("swept")
@pytest.mark.parametrize("patience", [2, 9])
def test_a_place_is_gone_to_when_no_end_is_left_and_what_came_of_it_is_kept(scripted, scene, patience):
    kinds, made = scripted
    kinds["PlaceErrand"].steps = 4
    explorer = explorer_at(scene, config=replace(NO_SWEEP, patience_m=0.15 * patience))
    decision = ask(explorer, scene, [])
    assert (decision.goal.kind, decision.goal.wall, decision.goal.side) == ("unseen", None, None)
    np.testing.assert_array_equal(decision.goal.position_world, [1.0, 1.5])
    assert decision.goal.reason == "unseen floor is left"
    assert decision.walls_to_follow == ()
    assert made[0].given[1:] == ("to where unseen floor", FollowingConfig())
    for _ in range(4):
        left = ask(explorer, scene, []).given_up
    assert left.troubles_at(PLACE.centre_world)[0] == (
        f"not reached in {patience} steps" if patience < 4 else "a cupboard"
    )


@pytest.mark.usefixtures("swept")
@pytest.mark.parametrize("trouble", ["", "the way was blocked"])
def test_a_place_is_visited_twice_and_what_came_of_it_is_kept(scripted, scene, trouble):
    kinds, made = scripted
    kinds["PlaceErrand"].trouble = trouble
    explorer = explorer_at(scene)
    places = ask(explorer, scene, []).given_up.places
    assert names(made) == ["PlaceErrand", "PlaceErrand"]
    assert [left.trouble for left in places] == [trouble, trouble]
    np.testing.assert_allclose(places[0].position_world, [1.0, 1.5])


@pytest.mark.usefixtures("swept")
def test_a_sweep_is_dropped_as_soon_as_there_is_an_end(scripted, scene):
    kinds, made = scripted
    kinds["PlaceErrand"].steps = kinds["EndErrand"].steps = 99
    explorer = explorer_at(scene)
    ask(explorer, scene, [])
    assert ask(explorer, scene, ends_at((1, 2))).goal.kind == "open-end"
    assert names(made) == ["PlaceErrand", "EndErrand"]


def test_a_mission_begins_with_turns_on_the_spot_and_never_again(scripted, scene):
    _, made = scripted
    explorer, ends = explorer_at(scene, config=replace(NO_SWEEP, first_turns=3)), ends_at((1, 2))
    turns = [ask(explorer, scene, ends) for _ in range(3)]
    assert all(each.command.forward_m == 0.0 and "first turns" in each.words for each in turns)
    assert np.all([each.command.turn_rad == NO_SWEEP.robot.turn_rad for each in turns])
    assert not made
    explorer.start_over()
    ask(explorer, scene, ends)
    assert names(made) == ["EndErrand"]


@pytest.mark.parametrize("sweep", [True, False])
def test_unseen_floor_is_visited_if_it_is_to_be_and_the_trouble_there_is_told(scripted, scene_of, sweep):
    kinds, _ = scripted
    kinds["PlaceErrand"].steps = 1
    scene = scene_of(3, looks=1)
    explorer = explorer_at(scene, config=replace(NO_SWEEP, sweep=sweep))
    decision = ask(explorer, scene, [])
    assert (decision.goal is not None) == sweep
    if sweep:
        assert decision.goal.kind == "unseen"
        left = ask(explorer, scene, []).given_up
        assert left.troubles_at(decision.goal.position_world)[0] == "a cupboard"


class Watcher(First):
    """Looks at every step."""

    def __init__(self):
        self.seen = []

    def watch(self, around):
        self.seen.append(around)


def test_a_strategy_that_watches_is_shown_every_step(scripted, scene):
    kinds, _ = scripted
    kinds["EndErrand"].steps = 99
    watcher = Watcher()
    explorer = explorer_at(scene, watcher)
    for _ in range(3):
        ask(explorer, scene, ends_at((1, 2)))
    assert len(watcher.seen) == 3
    assert all(around.walls is not None for around in watcher.seen)


def test_starting_over_forgets_the_goal_and_what_was_given_up(scripted, scene):
    kinds, made = scripted
    kinds["EndErrand"].looks_done = 1
    explorer = explorer_at(scene)
    ends = ends_at((1, 2))
    assert ask(explorer, scene, ends).given_up.ends
    explorer.start_over()
    ask(explorer, scene, ends)
    assert names(made) == ["EndErrand", "EndErrand"]
