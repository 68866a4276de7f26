"""Errands that follow a script, and an explorer among them."""

from dataclasses import replace

import networkx as nx
import numpy as np

from chainslam.explore.following.wall_following import Errand
from chainslam.explore.goals.explorer import Explorer
from chainslam.explore.goals.explorer_config import ExplorerConfig
from chainslam.explore.strategies import Choice
from chainslam.slam.map.chains import Chain, OpenEnd
from chainslam.slam.robot import MotionCommand

ON = MotionCommand(0.1, 0.0)
NO_SWEEP = replace(ExplorerConfig(), sweep=False, first_turns=0)


class Scripted(Errand):
    """An errand that goes on until its steps are used up; what it was made of and told is kept."""

    made: list["Scripted"]
    steps = 0
    looks_done = 0
    trouble = "a cupboard"
    walls_to_follow = ()

    def _plan(self, around):
        return None

    def __init__(self, *given):
        self.given, self.told, self.doing = given, [], "on its way"
        self.end = given[0]
        self.made.append(self)

    def command(self, around):
        self.steps -= 1
        return ON if self.steps >= 0 else None

    def follow(self, end):
        self.told.append(end)

    def interrupt(self, around):
        self.told.append(around)


class First:
    """Goes to the first open end there is, as long as `holds` says so."""

    holding = True

    def choose(self, situation):
        self.situation = situation
        ends = situation.open_ends
        return Choice(ends[0], "the first", self._holds) if ends else None

    def _holds(self, around):
        return self.holding and around.walls is not None


def explorer_at(scene, strategy=None, config=NO_SWEEP):
    return Explorer(strategy or First(), scene.places[0], config)


def around_of(scene):
    return scene.situation(np.append(scene.places[0], 0.0), []).around


def ends_at(*places, wall=0):
    """Open ends of walls 0, 1, ... at some places."""
    return [OpenEnd(wall + k, 1, np.array(place, dtype=float)) for k, place in enumerate(places)]


def ask(explorer, scene, ends, graph=None):
    chains = tuple(Chain((end.wall,), np.zeros((0, 2)), (end,)) for end in ends)
    return explorer.decide(around_of(scene), chains, graph or nx.DiGraph())


def names(made):
    return [type(errand).__name__ for errand in made]
