"""Which ends the explorer gives up, and where it tries them again; its errands follow a script."""

from dataclasses import replace

import pytest

from chainslam.explore.floor.free_space import FreeSpace, FreeSpaceConfig
from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.explore.goals import explorer as explorer_module
from chainslam.explore.outcome import Outcome
from tests.explore.goals.scripted import NO_SWEEP, Scripted, ask, ends_at, explorer_at


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


@pytest.fixture
def papers(monkeypatch):
    """The paper's errand as a script that goes on for long."""
    made = []
    script = {"made": made, "steps": 99, "is_open": lambda self, ends: True}
    monkeypatch.setattr(explorer_module, "PaperErrand", type("PaperErrand", (Scripted,), script))
    return made


PAPER = replace(NO_SWEEP, following=FollowingConfig(method="paper"), patience_m=0.45)


def test_the_paper_follows_walls_round_pillars_too(papers, scene, monkeypatch):
    monkeypatch.setattr(explorer_module, "is_round", lambda end, walls, config: True)
    decision = ask(explorer_at(scene, config=PAPER), scene, ends_at((5, 2), (2, 2)))
    assert not decision.given_up.ends
    assert decision.goal.wall == 0


def test_the_paper_follows_a_wall_to_its_end_however_long_it_is(papers, scene):
    """Three steps are the patience of this explorer."""
    explorer, ends = explorer_at(scene, config=PAPER), ends_at((5, 2))
    for _ in range(9):
        decision = ask(explorer, scene, ends)
        assert decision.command is not None
        assert not decision.given_up.ends
    assert len(papers) == 1


@pytest.mark.parametrize("aside", [0, 2])
def test_the_end_says_how_many_ends_cannot_be_closed(scripted, scene, aside):
    kinds, _ = scripted
    kinds["EndErrand"].looks_done = 1
    explorer = explorer_at(scene)
    ends = ends_at((1, 2), (4, 4))[:aside]
    decision = ask(explorer, scene, ends)
    if aside:
        assert decision.command is not None  # once more, for ends that were given up just now may join
        decision = ask(explorer, scene, ends)
    assert decision.command is None
    assert decision.outcome is (Outcome.NONE_REACHABLE if aside else Outcome.ALL_CLOSED)
    words = "no reachable open end is left; 2 cannot be closed" if aside else "every chain is closed"
    assert decision.words == words
