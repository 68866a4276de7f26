"""The factor graph against a dense least-squares solution of the whole problem."""

import numpy as np
import pytest

from chainslam.experiments.scoring.without_truth.relation_noise import relation_covs
from chainslam.experiments.scoring.without_truth.relations import between
from chainslam.slam.backends.graph.batch import GraphBatch
from chainslam.slam.backends.graph.config import GraphConfig
from chainslam.slam.backends.graph.graph import Graph
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import compose, rotation, to_world, wrap
from chainslam.slam.robot import Odometry
from tests.slam.backends.trips import (
    HUNDREDTH_DEGREE,
    MILLIMETRE,
    ODOMETRY_COV,
    P0,
    START,
    Trip,
    assert_same,
    by_wall,
    everything,
)

pytestmark = pytest.mark.usefixtures("_unchecked")


@pytest.mark.parametrize("form", ["shared", "plain"])
@pytest.mark.parametrize("kind", [Graph, GraphBatch])
def test_the_graph_is_the_dense_least_squares_solution(kind, form):
    # Two forms of the error that differ in second order: small angle errors make them one.
    trip = Trip.record(1, steps=30, sigmas=(0.01, 0.005) if form == "shared" else (0.003, 0.003))
    backend = trip.run(kind(START, P0))
    if kind is GraphBatch:
        smoothed = backend.finish()
    else:
        backend.relinearise()
        smoothed = backend.trajectory()
    joint = by_wall(trip, backend)
    poses, lines, cov = trip.dense(joint.anchors, form)
    np.testing.assert_allclose(smoothed[:, :2], poses[:, :2], atol=MILLIMETRE)
    np.testing.assert_allclose(wrap(smoothed[:, 2] - poses[:, 2]), 0.0, atol=HUNDREDTH_DEGREE)
    found = joint.mean[3:].reshape(-1, 2)
    np.testing.assert_allclose(wrap(found[:, 0] - lines[:, 0]), 0.0, atol=HUNDREDTH_DEGREE)
    np.testing.assert_allclose(found[:, 1], lines[:, 1], atol=MILLIMETRE)
    index = np.arange(3 * len(poses) - 3, len(cov))
    truth = cov[np.ix_(index, index)]
    sigma = np.sqrt(np.diag(truth))
    np.testing.assert_allclose(np.diag(joint.cov), np.diag(truth), rtol=0.01)
    np.testing.assert_allclose(joint.cov / np.outer(sigma, sigma), truth / np.outer(sigma, sigma), atol=0.01)


def test_the_batch_solution_is_the_dense_one_even_where_directions_are_known_to_five_degrees():
    trip = Trip.record(2, steps=25, walls=6, sigmas=(0.09, 0.004))
    backend = trip.run(GraphBatch(START, P0))
    smoothed = backend.finish()
    poses, _, _ = trip.dense(by_wall(trip, backend).anchors)
    np.testing.assert_allclose(smoothed[:, :2], poses[:, :2], atol=MILLIMETRE)
    np.testing.assert_allclose(wrap(smoothed[:, 2] - poses[:, 2]), 0.0, atol=2 * HUNDREDTH_DEGREE)


@pytest.mark.parametrize("slip", [1.0, 5.0])
def test_step_by_step_the_graph_stays_within_a_few_hundredths_of_a_sigma_of_the_optimum(slip):
    """Also where the wheels slip by four degrees a step, so that no prediction is a point to linearise at."""
    trip = Trip.record(3, sigmas=(0.004, 0.002), odometry_cov=slip**2 * ODOMETRY_COV)
    stepwise, batch = trip.run(Graph(START, P0)), Trip.run(trip, GraphBatch(START, P0))
    assert stepwise.recoveries == 0
    batch.finish()
    a, b = everything(stepwise), everything(batch)
    sigma = np.sqrt(np.diag(b.cov))
    shift = np.sum(normals(b.mean[3::2]) * (a.anchors - b.anchors), axis=-1)
    off = a.mean - b.mean
    off[4::2] += shift
    off[2], off[3::2] = wrap(off[2]), wrap(off[3::2])
    assert np.abs(off / sigma).max() < 0.1


def test_without_asking_in_between_the_end_is_the_same():
    trip = Trip.record(4)
    asked, silent = trip.run(GraphBatch(START, P0)), trip.run(GraphBatch(START, P0), ask=False)
    np.testing.assert_allclose(silent.finish(), asked.finish(), atol=1e-7)


def test_lines_asked_for_in_another_order_than_in_the_step_before_have_their_own_covariance():
    """What was asked for is asked for again ahead of the next question."""
    trip = Trip.record(4, steps=20)
    graph = trip.run(Graph(START, P0))
    graph.belief.joint(graph.belief.ids[::-1])
    wall, line, cov, _ = trip.seen[-1][0]
    graph.update(*(Observations(np.array([trip.ids[wall]]), line[None], cov[None]),) * 2)
    found = everything(graph)
    graph.relinearise()
    assert_same(found, everything(graph))


def test_several_predictions_in_a_row_each_make_a_pose():
    trip = Trip.record(5, steps=4)
    backend = trip.run(Graph(START, P0))
    backend.relinearise()
    before = everything(backend)
    for _ in range(3):
        backend.predict(Odometry(np.array([0.1, 0.02, 0.3]), ODOMETRY_COV))
    ahead = everything(backend)
    assert len(backend.trajectory()) == 4 + 3
    entered = everything(backend)
    assert_same(entered, ahead, place=1e-9, angle=1e-9, cov=1e-3)
    assert np.linalg.eigvalsh(ahead.cov[:2, :2] - before.cov[:2, :2]).min() > 0


def test_a_rest_without_error_makes_no_pose_but_counts_as_a_step():
    backend = Graph(START, P0)
    before = everything(backend)
    backend.predict(Odometry(np.zeros(3), np.zeros((3, 3))))
    np.testing.assert_array_equal(everything(backend).cov, before.cov)
    np.testing.assert_allclose(backend.trajectory(), [START, START], atol=1e-12)


@pytest.mark.parametrize("world", [np.array([100.0, -100.0, 0.0]), np.array([-70.0, 70.0, 2.5])])
def test_moving_the_world_moves_the_answer(world):
    answers = []
    for origin in (np.zeros(3), world):
        turn = np.eye(3)
        turn[:2, :2] = rotation(origin[2])
        trip = Trip.record(6)
        answers.append(everything(trip.run(GraphBatch(compose(origin, START), turn @ P0 @ turn.T))))
    here, there = answers
    np.testing.assert_allclose(there.mean[:2], to_world(here.mean[None, :2], world)[0], atol=1e-9)
    np.testing.assert_allclose(there.mean[4::2], here.mean[4::2], atol=1e-9)
    np.testing.assert_allclose(wrap(there.mean[3::2] - here.mean[3::2] - world[2]), 0.0, atol=1e-9)
    np.testing.assert_allclose(there.cov[2:, 2:], here.cov[2:, 2:], atol=1e-9)


def test_a_wide_loop_closure_ends_at_the_optimum():
    """A drive whose heading has gone astray by degrees: the graph comes back without being asked to."""
    config = GraphConfig()
    trip = Trip.record(14, steps=120, walls=5)
    astray = lambda k, i: i > 1 and 0 < k < 60  # noqa: E731
    backend = trip.run(Graph(START, 0.01 * P0, config), skip=astray)
    found = everything(backend)
    backend.relinearise()
    backend.relinearise()
    assert_same(found, everything(backend), place=2e-3, angle=1e-3, cov=0.1)


def test_two_poses_err_together_as_in_the_dense_solution():
    trip = Trip.record(1, steps=30)
    backend = trip.run(Graph(START, P0))
    backend.relinearise()
    poses, _, cov = trip.dense(by_wall(trip, backend).anchors)
    first, second = np.array([0, 3, 20, 29]), np.array([29, 4, 7, 0])
    found = backend.pair_covs(first, second)
    for k, pair in enumerate(zip(first, second, strict=True)):
        index = np.concatenate([3 * pose + np.arange(3) for pose in pair])
        to_body = np.zeros((6, 6))
        for half, pose in enumerate(pair):
            to_body[3 * half : 3 * half + 2, 3 * half : 3 * half + 2] = rotation(-poses[pose, 2])
            to_body[3 * half + 2, 3 * half + 2] = 1.0
        truth = to_body @ cov[np.ix_(index, index)] @ to_body.T
        # The dense one has the error of the start on top, which moves both poses as one and no relation.
        motion = between(poses[[pair[0]]], poses[[pair[1]]])
        (mine,), (theirs,) = relation_covs(motion, found[[k]]), relation_covs(motion, truth[None])
        sigma = np.sqrt(np.diag(theirs))
        np.testing.assert_allclose(mine / np.outer(sigma, sigma), theirs / np.outer(sigma, sigma), atol=0.01)


def test_a_pose_and_itself_err_as_one_and_poses_before_the_map_have_no_covariance():
    graph = Graph(START, P0)
    graph.predict(Odometry(np.array([0.3, 0.0, 0.1]), ODOMETRY_COV))
    trip = Trip.record(1, steps=4)
    trip.run(graph)
    same, before = graph.pair_covs(np.array([3, 0]), np.array([3, 3]))
    np.testing.assert_allclose(relation_covs(np.zeros((1, 3)), same[None])[0], 0.0, atol=1e-12)
    assert np.all(np.isnan(before))
