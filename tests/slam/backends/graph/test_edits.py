"""What only a graph can do: merge without a loss."""

import numpy as np
import pytest

from chainslam.slam.backends.graph.graph import Graph
from chainslam.slam.estimation.backend import Observations, StaleBeliefError
from chainslam.slam.robot import Odometry
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


@pytest.mark.parametrize("verb", ["merge", "remove"])
def test_observations_leave_a_graph_that_was_not_asked_in_between(verb):
    """Motions and observations of several steps then enter together, and the observations alone are to leave."""
    trip = Trip.record(7, steps=12)
    graph = trip.run(Graph(START, P0), walls_of=lambda k, i: 99 if i == 2 and k > 5 else i, ask=False)
    if verb == "merge":
        graph.merge(trip.ids[2], trip.ids[99])
    else:
        pose, (_, line, cov, centre) = np.array([0.1, 0.0, 0.1]), trip.seen[3][0]
        graph.predict(Odometry(pose, trip.odometry_cov))
        once = graph.grow(line[None], cov[None], centre[None])
        graph.predict(Odometry(pose, trip.odometry_cov))
        graph.grow(line[None], cov[None], centre[None])
        graph.remove(once)
    found = everything(graph)
    assert graph.recoveries == 0
    graph.relinearise()
    assert_same(found, everything(graph))


def test_after_lines_were_forgotten_the_rest_goes_on_as_in_a_graph_made_anew():
    """One line seen several times, which stays inside, and one seen once, whose place in iSAM2 others take."""
    trip = Trip.record(7, steps=25)
    first = Trip(trip.start, trip.motions[:11], trip.seen[:12], trip.walls, trip.odometry_cov)
    graph = first.run(Graph(START, P0))
    _, line, cov, centre = trip.seen[11][0]
    once = graph.grow(line[None], cov[None], centre[None])
    graph.belief.joint([first.ids[2], int(once[0])])
    graph.remove([int(once[0]), first.ids[2]])
    for motion, seen in zip(trip.motions[11:], trip.seen[12:], strict=True):
        graph.predict(Odometry(motion, trip.odometry_cov))
        seen = [each for each in seen if each[0] != 2 and each[0] in first.ids]
        ids = np.array([first.ids[each[0]] for each in seen])
        observed = Observations(ids, np.array([each[1] for each in seen]), np.array([each[2] for each in seen]))
        graph.update(observed, observed)
        found = everything(graph)
    assert graph.recoveries == 0
    graph.relinearise()
    assert_same(found, everything(graph), place=2e-3, angle=3e-4, cov=0.02)


@pytest.mark.parametrize("verb", ["merge", "trajectory", "relinearise"])
def test_what_only_a_graph_can_do_makes_beliefs_stale_too(verb):
    trip = Trip.record(11, steps=20)
    backend = trip.run(Graph(START, P0))
    belief = backend.belief
    getattr(backend, verb)(*((trip.ids[0], trip.ids[1]) if verb == "merge" else ()))
    with pytest.raises(StaleBeliefError):
        belief.joint(belief.ids[:1])
    everything(backend)


@pytest.mark.parametrize("turn_rad", [-0.2, 0.0, 0.1])
def test_an_observation_is_weighed_by_the_angle_by_which_it_departs_from_its_line(turn_rad):
    """The odometry is certain of the heading, so that the pose does not turn to explain it."""
    graph = Graph(np.zeros(3), 1e-6 * np.eye(3))
    cov = np.diag([0.05, 0.01])[None] ** 2
    ids = graph.grow(np.array([[0.3, 2.0]]), cov, np.array([[1.9, 0.6]]))
    graph.predict(Odometry(np.array([0.1, 0.0, 0.0]), np.diag([1e-4, 1e-4, 1e-12])))
    seen = Observations(ids, np.array([[0.3 + turn_rad, 1.9]]), cov)
    graph.update(seen, seen)
    first, again = graph.record.lines[int(ids[0])].observations
    assert first.epsilon == pytest.approx(0.0, abs=1e-9)
    assert again.epsilon == pytest.approx(turn_rad, abs=1e-3)
