"""Where an open end is looked at from, in which order, when some of the places cannot be reached."""

from unittest.mock import Mock

import numpy as np
import pytest

from chainslam.explore.following import end_errand
from chainslam.explore.following.end_errand import EndErrand
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.following.wall_following import FollowingConfig
from chainslam.explore.planning.paths import Planner
from chainslam.slam.map.chains import OpenEnd

KINDS = ("places_near", "places_beyond", "places_that_see")


def set_out(errand, around, planner, places):
    """Drive to the first of some places, if there is one."""
    if len(places):
        errand._pilot = Mock(destination_world=places[0])
    return len(places) > 0


@pytest.fixture
def doings(monkeypatch):
    """What an errand says while it drives to whatever places of some kinds it asks for, all others out of reach."""
    reachable, asked = set(), []

    def places_of(kind):
        def places(*_):
            asked.append(kind)
            return np.array([[float(len(asked)), 0.0]])

        return places

    def drive(self, around, planner, places):
        return asked[-1] in reachable and set_out(self, around, planner, places)

    for kind in KINDS:
        monkeypatch.setattr(end_errand, kind, places_of(kind))
    monkeypatch.setattr(end_errand, "ideal_places", lambda *_: np.arange(8.0).reshape(4, 2) / 2)
    monkeypatch.setattr(EndErrand, "_planner", Mock(return_value=Mock(spec=Planner)))
    monkeypatch.setattr(EndErrand, "_drive", drive)

    def say(*kinds):
        reachable.update(kinds)
        errand, said = EndErrand(OpenEnd(3, 1, np.zeros(2)), FollowingConfig()), []
        around = Mock(spec=Surroundings, scan=Mock(range_max_m=4.0), walls=Mock(), free_space=Mock())
        while errand._plan(around):
            said.append(errand.doing.removesuffix(" the open end of wall 3"))
            errand._arrived()
        return said, errand.trouble

    return say


def test_only_past_an_end_and_round_it_a_place_farther_off_will_do(doings):
    assert doings("places_beyond") == (["to look past", "to look round"], "")


def test_an_end_that_was_looked_at_from_its_own_places_is_not_looked_at_from_anywhere_else(doings):
    looks = ["to look in front of", "to look past", "to look round", "to look close to"]
    assert doings("places_near", "places_that_see") == (looks, "")


def test_an_end_without_a_place_of_its_own_is_looked_at_once_from_wherever_it_is_seen(doings):
    assert doings("places_that_see") == (["to where the open end of wall 3 can be seen"], "")


def test_an_end_that_nobody_can_look_at_says_so(doings):
    assert doings() == ([], "no place that the robot can reach sees it")


@pytest.mark.parametrize(("share", "looks"), [(0.9, 2), (1.1, 4)])
def test_no_look_is_made_where_an_earlier_one_was(doings, monkeypatch, share, looks):
    """Each place lies so many times the least distance from the one before."""
    apart = share * FollowingConfig().apart_m
    monkeypatch.setattr(end_errand, "places_near", lambda ideal, *_: np.array([[apart * ideal[0], 0.0]]))
    monkeypatch.setattr(end_errand, "places_beyond", lambda *_: np.zeros((0, 2)))
    monkeypatch.setattr(EndErrand, "_drive", set_out)
    assert len(doings()[0]) == looks
