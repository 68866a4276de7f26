"""What only a graph can do: take back lines and observations, go on from a file."""

import numpy as np
import pytest

from slam.backends.graph.batch import GraphBatch
from slam.backends.graph.graph import Graph
from slam.estimation.backend import StaleBeliefError
from slam.robot import Odometry
from tests.slam.backends.trips import ODOMETRY_COV, P0, START, Trip, assert_same, everything, look, see

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


def test_retracting_a_line_equals_a_run_without_its_observations():
    trip = Trip.record(8)
    full = trip.run(Graph(START, P0))
    gone = trip.ids[3]
    kept = {i: line for i, line in trip.ids.items() if i != 3}
    full.retract([gone])
    without = trip.run(Graph(START, P0), skip=lambda k, i: i == 3)
    full.relinearise()
    without.relinearise()
    # Anchors may differ by where the pose was thought to be: compare poses, and lines by what they say there.
    a = full.belief.joint(list(kept.values()))
    b = without.belief.joint([trip.ids[i] for i in kept])
    np.testing.assert_allclose(full.trajectory(), without.trajectory(), atol=1e-4)
    np.testing.assert_allclose(a.mean[3::2], b.mean[3::2], atol=1e-5)
    np.testing.assert_allclose(a.cov[:3, :3], b.cov[:3, :3], atol=1e-3 * np.trace(b.cov[:3, :3]))
    with pytest.raises(KeyError):
        full.observations_of(gone)


def test_retracting_a_wrong_match_equals_a_run_without_it():
    trip = Trip.record(9)
    wrong = trip.run(Graph(START, P0))
    wrong.relinearise()
    line, rng = trip.ids[0], np.random.default_rng(1)
    before = everything(wrong)
    sane = len(wrong.observations_of(line))
    z, cov, _ = look(wrong.belief.pose_world, START[:2], 0.3, (0.01, 0.005), rng)
    see(wrong, [line], [z], [cov])
    wrong_number, step = wrong.observations_of(line)[-1].tolist()
    assert step == len(trip.seen) - 1
    assert np.abs(everything(wrong).mean - before.mean).max() > 0.01
    wrong.retract_observations(line, [wrong_number])
    assert len(wrong.observations_of(line)) == sane
    wrong.relinearise()
    assert_same(everything(wrong), before, place=2e-4, angle=2e-4, cov=0.01)
    with pytest.raises(KeyError):
        wrong.retract_observations(line, [wrong_number])


def test_a_line_without_any_observation_left_is_gone():
    trip = Trip.record(10, steps=3)
    backend = trip.run(Graph(START, P0))
    line = next(iter(trip.ids.values()))
    backend.retract_observations(line, backend.observations_of(line)[:, 0].tolist())
    assert line not in backend.belief.ids
    everything(backend)


@pytest.mark.parametrize("verb", ["merge", "retract", "retract_observations", "trajectory", "relinearise", "arrays"])
def test_what_only_a_graph_can_do_makes_beliefs_stale_too(verb):
    trip = Trip.record(11, steps=20)
    backend = trip.run(Graph(START, P0))
    a, b, c = (trip.ids[i] for i in (0, 1, 2))
    belief = backend.belief
    number = int(backend.observations_of(c)[-1, 0])
    arguments = {"merge": (a, b), "retract": ([a],), "retract_observations": (c, [number])}.get(verb, ())
    getattr(backend, verb)(*arguments)
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
