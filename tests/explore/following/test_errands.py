"""What an errand does where no step along its path is safe."""

from unittest.mock import Mock

import numpy as np
import pytest

from chainslam.explore.following import wall_following
from chainslam.explore.following.driving import Pilot
from chainslam.explore.following.end_errand import EndErrand
from chainslam.explore.following.surroundings import Surroundings
from chainslam.explore.following.wall_following import FollowingConfig, PlaceErrand
from chainslam.slam.map.chains import OpenEnd
from chainslam.slam.robot import MotionCommand

CONFIG = FollowingConfig()
REST, STEP = MotionCommand(0.0, 0.0), MotionCommand(0.1, 0.0)


@pytest.fixture
def errand(monkeypatch: pytest.MonkeyPatch) -> PlaceErrand:
    """An errand to one place, to which there is always a path."""

    def plan(self: PlaceErrand, around: Surroundings) -> bool:
        self._pilot = Pilot.__new__(Pilot)
        return self._stage == 0

    monkeypatch.setattr(PlaceErrand, "_plan", plan)
    for name, told in (("arrived", False), ("command", None)):
        monkeypatch.setattr(Pilot, name, lambda *_, told=told: told)
    return PlaceErrand(np.zeros((1, 2)), "there", CONFIG)


@pytest.fixture
def around() -> Mock:
    """The errand's pilot is told of it, and looks at nothing."""
    return Mock(spec=Surroundings)


def test_a_scan_that_leaves_no_safe_step_is_followed_by_another(errand, around, monkeypatch) -> None:
    """In a door 25 mm wider than the body on either side one scan of noise made a robot give up all that was left."""
    assert errand.command(around) == REST
    monkeypatch.setattr(Pilot, "command", lambda *_: STEP)
    assert errand.command(around) == STEP
    assert not errand.trouble


def test_after_as_many_scans_as_tries_the_place_is_given_up(errand, around) -> None:
    assert [errand.command(around) for _ in range(CONFIG.tries)] == [REST] * (CONFIG.tries - 1) + [None]
    assert errand.trouble == "the way was blocked"


def test_an_open_end_is_looked_at_twice_from_each_place_and_other_places_once(errand, around, monkeypatch) -> None:
    """The second scan has its beams between those of the first."""
    half = MotionCommand(0.0, 0.5 * CONFIG.robot.turn_rad)
    end = EndErrand(OpenEnd(3, 1, np.zeros(2)), CONFIG)
    for each, first in ((end, half), (errand, None)):
        each._pilot = Pilot.__new__(Pilot)
        monkeypatch.setattr(Pilot, "arrived", lambda *_: True)
        monkeypatch.setattr(
            wall_following, "spin", lambda _, share, config: MotionCommand(0.0, share * config.robot.turn_rad)
        )
        assert each.command(around) == first
        assert each.looks_done == 1
