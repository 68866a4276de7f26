"""What the ledger says of ends and places, against what was told to it."""

import numpy as np
import pytest

from chainslam.explore.goals.ledger import Event, Ledger
from chainslam.slam.map.chains import OpenEnd


def test_an_end_that_is_taken_up_is_given_up_no_longer_and_what_was_known_of_it_is_kept():
    ledger, ends = Ledger(0.3), [OpenEnd(wall, 1, np.array([float(wall), 0.0])) for wall in range(3)]
    for end in ends:
        ledger.put_aside(end, f"wall {end.wall}", known_cells=10 + end.wall)
    ledger.note_walk((0, 1))
    ledger.take_up((0, 1))
    ledger.take_up_unlooked((1, 1))
    assert [end.reason for end in ledger.given_up.ends] == ["wall 2"]
    assert ledger.unlooked() == [((0, 1), 10), ((2, 1), 12)]
    ledger.put_aside(ends[0], "again")
    assert [end.reason for end in ledger.given_up.ends] == ["wall 2", "again"]
    assert ledger.given_up.keys == {(2, 1), (0, 1)}
    assert ledger.end((0, 1)).was_walked
    assert not ledger.end((2, 1)).was_walked
    assert (ledger.end((0, 1)).set_aside.wall, ledger.end((0, 1)).known_cells) == (0, 10)


@pytest.mark.parametrize("near_m", [0.2, 0.5])
def test_events_are_counted_near_a_place_each_kind_by_itself(near_m):
    rng, ledger = np.random.default_rng(1), Ledger(near_m)
    places = {event: rng.uniform(0.0, 1.0, (20, 2)) for event in Event}
    for event, some in places.items():
        for k, place in enumerate(some):
            ledger.note(event, place, f"trouble {k}")
    here = np.array([0.5, 0.5])
    near = {event: np.flatnonzero(np.hypot(*(some - here).T) < near_m) for event, some in places.items()}
    assert {event: ledger.count(event, here) for event in Event} == {event: len(near[event]) for event in Event}
    assert ledger.given_up.troubles_at(here) == [f"trouble {k}" for k in near[Event.VISITED]]
