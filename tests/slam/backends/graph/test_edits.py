"""What only a graph can do: merge without a loss, go on from a file."""

import numpy as np
import pytest

from chainslam.slam.backends.graph.batch import GraphBatch
from chainslam.slam.backends.graph.graph import Graph
from chainslam.slam.estimation.backend import StaleBeliefError
from chainslam.slam.robot import Odometry
from tests.slam.backends.trips import ODOMETRY_COV, P0, START, Trip, assert_same, everything

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


@pytest.mark.parametrize("verb", ["merge", "trajectory", "relinearise", "arrays"])
def test_what_only_a_graph_can_do_makes_beliefs_stale_too(verb):
    trip = Trip.record(11, steps=20)
    backend = trip.run(Graph(START, P0))
    belief = backend.belief
    getattr(backend, verb)(*((trip.ids[0], trip.ids[1]) if verb == "merge" else ()))
    with pytest.raises(StaleBeliefError):
        belief.joint(belief.ids[:1])
    everything(backend)


@pytest.mark.parametrize("kind", [Graph, GraphBatch])
def test_saved_arrays_make_the_same_graph(kind, tmp_path):
    trip = Trip.record(12)
    backend = trip.run(kind(START, P0), walls_of=lambda k, i: 99 if i == 1 and k > 30 else i)
    backend.merge(trip.ids[1], trip.ids[99])
    backend.remove([trip.ids[2]])
    backend.predict(Odometry(trip.motions[0], ODOMETRY_COV))
    np.savez(tmp_path / "graph.npz", **backend.arrays())
    with np.load(tmp_path / "graph.npz", allow_pickle=False) as arrays:
        again = kind.from_arrays(arrays)
    a, b = everything(again), everything(backend)
    np.testing.assert_array_equal(again.belief.ids, backend.belief.ids)
    assert_same(a, b, place=1e-6, angle=1e-6, cov=1e-5)
    np.testing.assert_allclose(again.trajectory(), backend.trajectory(), atol=1e-6)
    line, cov, centre = trip.seen[0][0][1:]
    assert again.grow(line[None], cov[None], centre[None]) == backend.grow(line[None], cov[None], centre[None])
    if kind is GraphBatch:
        np.testing.assert_allclose(again.finish(), backend.finish(), atol=1e-8)


def test_another_format_is_refused():
    arrays = Graph(START, P0).arrays()
    with pytest.raises(ValueError, match="format"):
        Graph.from_arrays({**arrays, "format": np.array(99)})
