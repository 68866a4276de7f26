"""The paper's layers over one goal: which wall is followed next, and when the goal is given up."""

from dataclasses import replace
from typing import ClassVar

import networkx as nx
import numpy as np
import pytest

from chainslam.explore.following import paper_errand
from chainslam.explore.following.paper_errand import PaperErrand
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.slam.map.chains import HEAD, TAIL, OpenEnd
from chainslam.slam.robot import MotionCommand, Scan

pytestmark = pytest.mark.usefixtures("_unchecked")
ON = MotionCommand(0.1, 0.0)
CONFIG = FollowingConfig(method="paper", navigation="visibility", ping_pongs=2)


class Follower:
    """Goes to and fro at every tenth command; the walls of `blocked` cannot be reached."""

    blocked = ()
    made: ClassVar = []

    def __init__(self, wall, side, config):
        self.wall, self.side, self.behaviour, self.trouble, self.doing = wall, side, None, "", ""
        self.commands = 0
        self.made.append(self)

    @property
    def ping_pongs(self):
        return self.commands // 10

    def command(self, around):
        self.commands += 1
        self.trouble = "no way" if self.wall in self.blocked else ""
        return None if self.trouble else ON


@pytest.fixture
def followers(monkeypatch):
    monkeypatch.setattr(Follower, "made", [])
    monkeypatch.setattr(Follower, "blocked", ())
    monkeypatch.setattr(paper_errand, "WallFollower", Follower)
    return Follower


def end_of(scene, wall, side=HEAD):
    return OpenEnd(wall, side, scene.faces[wall, side])


def around(scene, place, graph=None, walls=None):
    scan = Scan(np.linspace(-3.1, 3.1, 180), np.full(180, np.inf), 0.01, 1.0, 0.0)
    walls = scene.walls(np.append(place, 0.0)) if walls is None else walls
    return Surroundings(walls, scene.grid, scan, graph=nx.DiGraph() if graph is None else graph)


def commands(errand, around, most=1000):
    """Return how many commands the errand gives."""
    for count in range(most):
        if errand.command(around) is None:
            return count
    raise AssertionError("the errand has no end")


def test_a_goal_is_given_up_after_the_stated_times_to_and_fro(scene_of, followers):
    scene = scene_of(0)
    for times in (1, 2, 3):
        errand = PaperErrand(end_of(scene, 2), replace(CONFIG, navigation="floor", ping_pongs=times))
        assert commands(errand, around(scene, scene.places[0])) == 10 * times
        assert "nothing new" in errand.trouble


def test_a_change_of_the_map_begins_the_count_anew(scene_of, followers):
    scene = scene_of(0)
    now = around(scene, scene.places[0])
    errand = PaperErrand(end_of(scene, 2), replace(CONFIG, navigation="floor"))
    for _ in range(15):
        assert errand.command(now) is not None
    tentative = now.walls.tentative.copy()
    tentative[5] = True
    changed = replace(now, walls=replace(now.walls, tentative=tentative))
    assert commands(errand, changed) == 20 + 10 - 15


@pytest.mark.parametrize(("by_m", "more"), [(0.5, 20 + 10 - 15), (0.1, 20 - 15)])
def test_an_end_that_moves_begins_the_count_anew(scene_of, followers, by_m, more):
    """Not one that moves by as little as the map's noise."""
    scene = scene_of(0)
    now = around(scene, scene.places[0])
    errand = PaperErrand(end_of(scene, 2), replace(CONFIG, navigation="floor"))
    for _ in range(15):
        assert errand.command(now) is not None
    extents = now.walls.extents.copy()
    extents[2, HEAD] += by_m
    moved = replace(now, walls=replace(now.walls, extents=extents))
    assert commands(errand, moved) == more


def hidden_from(scene):
    """Return a place and two walls: one in reach of it, one that no straight way leads to."""
    for place in scene.places[:30]:
        errand = PaperErrand(end_of(scene, 0), CONFIG)
        near = errand._near(around(scene, place))
        far = [wall for wall in range(len(scene.faces)) if wall not in near]
        if near and far:
            return place, near, far
    raise AssertionError("every wall is near to every place")


def test_navigation_gives_the_walls_one_after_the_other(scene_of, followers):
    scene = scene_of(0)
    place, near, far = hidden_from(scene)
    goal = far[0]
    errand = PaperErrand(end_of(scene, goal), CONFIG)
    assert errand.command(around(scene, place, nx.DiGraph([(near[0], goal)]))) is ON
    assert errand.walls_to_follow == (near[0], goal)
    assert followers.made[-1].wall == near[0]


def test_where_the_first_wall_leads_no_farther_another_sequence_is_taken(scene_of, followers):
    scene = scene_of(0)
    place, near, far = hidden_from(scene)
    assert len(near) >= 2
    goal, graph = far[0], nx.DiGraph([(near[0], far[0]), (near[1], far[0])])
    followers.blocked = (near[0],)
    errand = PaperErrand(end_of(scene, goal), CONFIG)
    for _ in range(3):
        assert errand.command(around(scene, place, graph)) is ON
    assert errand.walls_to_follow == (near[1], goal)


def test_without_a_sequence_the_goal_itself_is_approached_and_then_given_up(scene_of, followers):
    scene = scene_of(0)
    place, _, far = hidden_from(scene)
    followers.blocked = (far[0],)
    errand = PaperErrand(end_of(scene, far[0]), CONFIG)
    assert errand.command(around(scene, place)) is None
    assert errand.walls_to_follow == (far[0],)
    assert errand.trouble == "no way"


def test_the_goal_holds_while_its_wall_is_first_or_last_of_a_chain(scene_of):
    errand = PaperErrand(end_of(scene_of(0), 2), CONFIG)
    assert errand.is_open({(2, TAIL)})
    assert errand.is_open({(2, HEAD)})
    assert not errand.is_open({(3, HEAD)})
