"""Where a factor graph would break down: maps that begin in the blind, solvers that fail, solutions that go astray."""

import gtsam
import numpy as np
import pytest

from chainslam.slam.backends.graph.batch import GraphBatch
from chainslam.slam.backends.graph.graph import Graph, UnsolvableError
from chainslam.slam.backends.graph.isam import DivergedError, Isam
from chainslam.slam.estimation.backend import ContradictionError, Observations
from chainslam.slam.geometry.lines import normals
from chainslam.slam.geometry.poses import compose, wrap
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
    look,
)

pytestmark = pytest.mark.usefixtures("_unchecked")

FORWARD = np.array([0.15, 0.0, 0.0])


def blind(backend, steps, sigmas, rng, true):
    """Drive ahead without seeing anything; return the true pose."""
    for _ in range(steps):
        backend.predict(Odometry(FORWARD, np.diag(sigmas) ** 2))
        true = compose(true, FORWARD + np.asarray(sigmas) * rng.standard_normal(3))
    return true


def along_a_wall(backend, steps, sigmas, rng, true):
    """Come upon a wall 0.5 m to the left and drive along it: each scan tells its distance, none how far along."""
    alpha = wrap(true[2] + np.pi / 2)
    r, ids = normals(alpha) @ true[:2] + 0.5, None
    for _ in range(steps):
        ahead, off = wrap(alpha - np.pi / 2 - true[2]), r - normals(alpha) @ true[:2] - 0.5
        motion = FORWARD + np.array([0.0, 0.0, np.clip(ahead + 0.3 * off, -0.15, 0.15)])
        true = compose(true, motion + np.asarray(sigmas) * rng.standard_normal(3))
        backend.predict(Odometry(motion, np.diag(sigmas) ** 2))
        foot = true[:2] + (r - normals(alpha) @ true[:2]) * normals(alpha)
        line, cov, centre = look(true, foot, alpha, np.array([0.003, 0.001]), rng)
        if ids is None:
            ids = backend.grow(line[None], cov[None], centre[None])
        else:
            backend.update(*(Observations(ids, line[None], cov[None]),) * 2)
        belief = backend.belief
        assert np.all(np.isfinite(belief.joint(belief.ids).cov))
    return true


@pytest.mark.parametrize(("steps", "sigmas"), [(100, (0.05, 0.02, 0.05)), (20, (0.5, 0.5, 0.3))])
def test_a_wall_seen_first_after_metres_in_the_blind_can_be_followed(steps, sigmas):
    rng, graph = np.random.default_rng(0), Graph(START, P0)
    true = blind(graph, steps, sigmas, rng, START)
    along_a_wall(graph, 60, sigmas, rng, true)
    assert graph.recoveries == 0
    assert len(graph.trajectory()) == 1 + steps + 60


def test_what_gtsam_refuses_after_a_long_way_without_walls_is_solved_all_the_same():
    """The second wall is known to a millimetre across and to metres along: Cholesky's pivots lose all their digits."""
    rng, graph, sigmas = np.random.default_rng(0), GraphBatch(START, P0), (0.1, 0.05, 0.1)
    true = along_a_wall(graph, 5, (0.02, 0.01, 0.03), rng, START)
    true = blind(graph, 40, sigmas, rng, true)
    along_a_wall(graph, 40, sigmas, rng, true)
    assert graph.recoveries == 1
    found = everything(graph)
    graph.finish()
    best = everything(graph)
    sigma = np.sqrt(np.diag(best.cov))
    assert np.abs((found.mean - best.mean) / sigma).max() < 0.1
    np.testing.assert_allclose(np.diag(found.cov), np.diag(best.cov), rtol=0.05)
    assert graph.recoveries == 1


@pytest.mark.parametrize("kind", [Graph, GraphBatch])
def test_a_map_that_begins_in_the_blind_is_the_dense_solution_from_the_first_pose_on(kind):
    trip = Trip.record(1, steps=30, odometry_cov=4.0 * ODOMETRY_COV)
    trip.seen[:12] = [[] for _ in range(12)]
    backend = trip.run(kind(START, P0))
    if kind is GraphBatch:
        smoothed = backend.finish()
    else:
        backend.relinearise()
        smoothed = backend.trajectory()
    joint = by_wall(trip, backend)
    poses, lines, cov = trip.dense(joint.anchors)
    np.testing.assert_allclose(smoothed[:, :2], poses[:, :2], atol=MILLIMETRE)
    np.testing.assert_allclose(wrap(smoothed[:, 2] - poses[:, 2]), 0.0, atol=HUNDREDTH_DEGREE)
    np.testing.assert_allclose(joint.mean[4::2], lines[:, 1], atol=MILLIMETRE)
    index = np.arange(3 * len(poses) - 3, len(cov))
    truth = cov[np.ix_(index, index)]
    sigma = np.sqrt(np.diag(truth))
    np.testing.assert_allclose(joint.cov / np.outer(sigma, sigma), truth / np.outer(sigma, sigma), atol=0.01)


@pytest.mark.parametrize("odometry_cov", [np.diag([1e-4, 0.0, 1e-4]), np.zeros((3, 3)), 1e-20 * np.eye(3)])
def test_wheels_that_know_something_exactly_break_nothing(odometry_cov):
    trip = Trip.record(2, steps=30)
    trip.odometry_cov = odometry_cov
    backend = trip.run(GraphBatch(START, np.zeros((3, 3))))
    assert backend.recoveries == 0
    smoothed = backend.finish()
    exact = np.diag(odometry_cov) < 1e-12
    moved = [compose(np.zeros(3), m) for m in trip.motions]
    for a, b, motion in zip(smoothed[:-1], smoothed[1:], moved, strict=True):
        c, s = np.cos(a[2]), np.sin(a[2])
        shift = np.array([[c, s], [-s, c]]) @ (b - a)[:2]
        off = np.array([*shift, wrap(b[2] - a[2])]) - motion
        np.testing.assert_allclose(off[exact], 0.0, atol=1e-3)
    assert np.linalg.eigvalsh(everything(backend).cov).min() > 0.0


# -- solvers that fail -----------------------------------------------------------------------------------------------


def failing(monkeypatch, when):
    """Let pushes into iSAM2 fail where `when` says so, before or after they were made; return the count so far."""
    push, count = Isam._push, [0]

    def fails(self):
        count[0] += 1
        if when(self, count[0]):
            self._isam.update(self._factors, self._values)  # Half of it is done already, as in GTSAM.
            raise RuntimeError("Indeterminate linear system detected")
        return push(self)

    monkeypatch.setattr(Isam, "_push", fails)
    return count


def seen_by(graph):
    return sum(len(line.observations) for line in graph.record.lines.values())


@pytest.mark.parametrize("kind", [Graph, GraphBatch])
def test_after_a_solver_that_failed_the_graph_is_the_dense_solution_still(kind, monkeypatch):
    trip = Trip.record(1, steps=30)
    failing(monkeypatch, lambda isam, count: count in (7, 20, 33))
    backend = trip.run(kind(START, P0))
    assert backend.recoveries == 3
    backend.relinearise()
    joint = by_wall(trip, backend)
    poses, lines, cov = trip.dense(joint.anchors)
    smoothed = backend.trajectory()
    np.testing.assert_allclose(smoothed[:, :2], poses[:, :2], atol=MILLIMETRE)
    np.testing.assert_allclose(joint.mean[4::2], lines[:, 1], atol=MILLIMETRE)
    index = np.arange(3 * len(poses) - 3, len(cov))
    np.testing.assert_allclose(np.diag(joint.cov), np.diag(cov)[index], rtol=0.01)


@pytest.mark.parametrize("fault", ["place", "heading", "not finite", "line", "line not finite"])
def test_a_solution_that_jumps_is_not_believed(fault, monkeypatch):
    trip = Trip.record(3, steps=20)
    whole = everything(trip.run(Graph(START, P0)))
    estimates, asked = Isam._estimates, [0]

    def jumps(self):
        asked[0] += 1
        pose, moved = estimates(self)
        off = {"place": [3e6, 0.0, 0.0], "heading": [0.0, 0.0, 1.0], "not finite": [np.nan] * 3}.get(fault, 0.0)
        turn = {"line": [3.0, 0.0], "line not finite": [0.0, np.inf]}.get(fault, 0.0)
        return (pose + off, moved + turn) if asked[0] == 15 else (pose, moved)

    monkeypatch.setattr(Isam, "_estimates", jumps)
    backend = trip.run(Graph(START, P0))
    assert backend.recoveries == 1
    # Anew or step by step, both are near the optimum.
    assert_same(everything(backend), whole, place=2e-3, angle=1e-3, cov=0.05)


@pytest.mark.parametrize(
    ("off", "holds"),
    [([1.0, 0.0, 0.0], True), ([0.0, 1.5, 0.0], False), ([0.0, 0.0, 0.03], True), ([0.0, 0.0, 0.05], False)],
)
def test_a_pose_is_held_within_some_thresholds_of_an_exact_prediction(off, holds):
    """Chi-square of three at 1e-9 is 44.8: 6.7 thresholds of 0.2 m and of 0.005 rad are 1.34 m and 0.033 rad."""
    isam = Graph(START, P0)._isam
    isam.pose = np.array(off)
    if holds:
        isam._hold_pose(np.zeros(3), np.zeros((3, 3)))
    else:
        with pytest.raises(DivergedError, match="chi-square 45"):
            isam._hold_pose(np.zeros(3), np.zeros((3, 3)))


def test_a_scan_that_no_solver_takes_is_taken_out_again_and_the_rest_holds(monkeypatch):
    trip = Trip.record(6, steps=20)
    backend = Graph(START, P0)
    first = Trip(trip.start, trip.motions[:14], trip.seen[:15], trip.walls, trip.odometry_cov)
    first.run(backend)
    backend.relinearise()
    before, path, told = everything(backend), backend.trajectory(), seen_by(backend)
    failing(monkeypatch, lambda isam, count: seen_by(backend) > told)
    backend.predict(Odometry(trip.motions[14], trip.odometry_cov))
    _, line, cov, centre = trip.seen[15][0]
    backend.update(*(Observations(np.array([first.ids[trip.seen[15][0][0]]]), line[None], cov[None]),) * 2)
    backend.grow(line[None], cov[None], centre[None])
    words = "expected a least-squares solution of 16 poses and 10 lines, found Inde"
    with pytest.raises(ContradictionError, match=words):
        backend.belief  # noqa: B018
    belief = backend.belief
    expected = compose(before.mean[:3], trip.motions[14])
    np.testing.assert_allclose(belief.pose_world, expected, atol=1e-4)
    np.testing.assert_array_equal(belief.ids, np.arange(9))
    after = belief.joint(belief.ids)
    np.testing.assert_allclose(after.mean[3:], before.mean[3:], atol=1e-4)
    np.testing.assert_allclose(np.diag(after.cov)[3:], np.diag(before.cov)[3:], rtol=0.01)
    np.testing.assert_allclose(backend.trajectory()[:-1], path, atol=1e-4)
    assert seen_by(backend) == told
    monkeypatch.undo()
    # It can go on, and an id is never used again.
    assert backend.grow(line[None], cov[None], centre[None]).tolist() == [10]
    assert len(everything(backend).anchors) == 10


def test_where_no_solution_is_left_the_last_one_is_still_told(monkeypatch):
    trip = Trip.record(6, steps=20)
    backend = Graph(START, P0)
    Trip(trip.start, trip.motions[:14], trip.seen[:15], trip.walls, trip.odometry_cov).run(backend)
    backend.relinearise()
    before, path, told = backend.belief, backend.trajectory(), seen_by(backend)
    failing(monkeypatch, lambda isam, count: True)
    backend.predict(Odometry(trip.motions[14], trip.odometry_cov))
    _, line, cov, centre = trip.seen[15][0]
    backend.grow(line[None], cov[None], centre[None])
    with pytest.raises(UnsolvableError, match="expected a solution without the last scan"):
        backend.trajectory()
    after = backend.belief
    np.testing.assert_array_equal(after.ids, before.ids)
    np.testing.assert_array_equal(after.means, before.means)
    found = backend.trajectory()
    np.testing.assert_allclose(found[:-1], path, atol=1e-3)
    np.testing.assert_allclose(found[-1], compose(path[-1], trip.motions[14]), atol=1e-3)
    with pytest.raises(UnsolvableError, match="begin a new one"):
        backend.remove(before.ids[:1])
    assert seen_by(backend) == told


def test_what_gtsam_raises_is_what_is_recovered_from():
    """A graph that GTSAM refuses raises an error of the kinds that `Graph` catches."""
    isam = gtsam.ISAM2()
    values = gtsam.Values()
    values.insert(gtsam.symbol("x", 0), gtsam.Pose3())
    graph = gtsam.NonlinearFactorGraph()
    graph.push_back(gtsam.PriorFactorPose3(gtsam.symbol("x", 1), gtsam.Pose3(), gtsam.noiseModel.Unit.Create(6)))
    from chainslam.slam.backends.graph.graph import FAULTS

    with pytest.raises(FAULTS):
        isam.update(graph, values)
