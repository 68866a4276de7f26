"""What only a graph can do: merge without a loss."""

import pytest

from chainslam.slam.backends.graph.graph import Graph
from chainslam.slam.estimation.backend import StaleBeliefError
from tests.slam.backends.trips import P0, START, Trip, assert_same, everything

pytestmark = pytest.mark.usefixtures("_unchecked")


def test_a_merged_run_equals_one_that_was_never_split():
    trip = Trip.record(7)
    whole = trip.run(Graph(START, P0))
    keep = trip.ids[2]
    split = trip.run(Graph(START, P0), walls_of=lambda k, i: 99 if i == 2 and k > 30 else i)
    keep_split, drop = trip.ids[2], trip.ids[99]
    split.merge(keep_split, drop)
    assert drop not in split.belief.ids
    whole.relinearise()
    split.relinearise()
    order = [trip.ids[i] for i in range(trip.walls)]
    assert keep == keep_split
    assert_same(split.belief.joint(order), whole.belief.joint(order), place=3e-4, angle=3e-4, cov=1e-3)


@pytest.mark.parametrize("verb", ["merge", "trajectory", "relinearise"])
def test_what_only_a_graph_can_do_makes_beliefs_stale_too(verb):
    trip = Trip.record(11, steps=20)
    backend = trip.run(Graph(START, P0))
    belief = backend.belief
    getattr(backend, verb)(*((trip.ids[0], trip.ids[1]) if verb == "merge" else ()))
    with pytest.raises(StaleBeliefError):
        belief.joint(belief.ids[:1])
    everything(backend)
