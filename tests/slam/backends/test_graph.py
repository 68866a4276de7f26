"""The factor graph against a dense least-squares solution of the whole problem, and what only a graph can do."""

from dataclasses import dataclass, field
from itertools import pairwise

import jaxtyping
import numpy as np
import pytest
from scipy.optimize import least_squares

from slam.backend import Observations, StaleBeliefError
from slam.backends.graph import Graph
from slam.backends.graph_batch import GraphBatch
from slam.backends.graph_isam import GraphConfig
from slam.geometry.lines import directions, normals
from slam.geometry.poses import compose, inverse, rotation, to_robot, to_world, wrap
from slam.models import innovations, lines_robot
from slam.robot import Odometry

P0 = np.array([[4e-4, 5e-5, 1e-5], [5e-5, 3e-4, -2e-5], [1e-5, -2e-5, 1e-4]])
ODOMETRY_COV = np.array([[1e-4, 2e-5, 3e-5], [2e-5, 4e-5, 1e-5], [3e-5, 1e-5, 2e-4]])
START = np.array([3.0, -2.0, 2.9])
MILLIMETRE, HUNDREDTH_DEGREE = 1e-3, np.deg2rad(0.01)


@pytest.fixture(autouse=True)
def _unchecked():
    """Without the shape checks that pytest adds: these tests solve many problems."""
    jaxtyping.config.update("jaxtyping_disable", True)
    yield
    jaxtyping.config.update("jaxtyping_disable", False)


@dataclass
class Trip:
    """A recorded drive with known association: per step the motion and the sightings (wall, line, cov, centre)."""

    start: np.ndarray
    motions: np.ndarray
    seen: list[list[tuple[int, np.ndarray, np.ndarray, np.ndarray]]]
    walls: int
    odometry_cov: np.ndarray
    ids: dict[int, int] = field(default_factory=dict)

    @classmethod
    def record(cls, seed=0, steps=60, walls=9, sigmas=(0.01, 0.005), start=START, odometry_cov=ODOMETRY_COV) -> "Trip":
        """Drive a circle inside walls with all directions (also alpha = pi) and both signs of r in the world."""
        rng = np.random.default_rng([4, seed])
        alpha = wrap(np.pi + 2 * np.pi * np.arange(walls) / walls)
        middle = compose(start, np.array([0.0, 1.2, 0.0]))[:2]
        points = middle + 3.0 * normals(alpha) + rng.uniform(-0.7, 0.7, (walls, 1)) * directions(alpha)
        true = compose(start, np.linalg.cholesky(P0) @ rng.standard_normal(3))
        motions, seen = [], []
        for k in range(steps):
            if k:
                motion = np.array([0.15, 0.0, 0.125])
                true = compose(true, motion + np.linalg.cholesky(odometry_cov) @ rng.standard_normal(3))
                motions.append(motion)
            rows = np.sort(rng.choice(walls, 4, replace=False))
            seen.append([(int(i), *look(true, points[i], alpha[i], sigmas, rng)) for i in rows])
        return cls(start, np.array(motions), seen, walls, odometry_cov)

    def run(self, backend, walls_of=lambda k, i: i, ask=True, skip=lambda k, i: False):
        """Feed a back end; wall `i` at step `k` counts as the line of `walls_of(k, i)`."""
        self.ids = {}
        for k, sightings in enumerate(self.seen):
            if k:
                backend.predict(Odometry(self.motions[k - 1], self.odometry_cov))
            sightings = [(walls_of(k, i), *rest) for i, *rest in sightings if not skip(k, i)]
            old = [s for s in sightings if s[0] in self.ids]
            new = [s for s in sightings if s[0] not in self.ids]
            if old:
                see(backend, [self.ids[s[0]] for s in old], [s[1] for s in old], [s[2] for s in old])
            if new:
                grown = backend.grow(*(np.array([s[j] for s in new]) for j in (1, 2, 3)))
                self.ids.update(zip([s[0] for s in new], grown.tolist(), strict=True))
            if ask:
                belief = backend.belief
                belief.joint(belief.ids[:4])
        return backend

    def dense(self, anchors: np.ndarray, form: str = "shared"):
        """Solve the whole problem with scipy; return poses, lines (alpha, d) by wall, and the covariance of all.

        `shared` takes errors as `slam.models.innovations` does, `plain` as differences of (alpha, r).
        """
        n, rows = len(self.seen), [(k, *s) for k, sightings in enumerate(self.seen) for s in sightings]
        step = np.array([r[0] for r in rows])
        wall = np.array([r[1] for r in rows])
        z, cov = np.array([r[2] for r in rows]), np.array([r[3] for r in rows])
        poses = [self.start]
        for motion in self.motions:
            poses.append(compose(poses[-1], motion))
        poses = np.array(poses)
        lines = np.zeros((self.walls, 2))
        for i in range(self.walls):
            first = int(np.flatnonzero(wall == i)[0])
            alpha = wrap(z[first, 0] + poses[step[first], 2])
            lines[i] = alpha, z[first, 1] + normals(alpha) @ (poses[step[first], :2] - anchors[i])
        prior, odometry = (np.linalg.cholesky(np.linalg.inv(P)).T for P in (P0, self.odometry_cov))
        weights = np.linalg.cholesky(np.linalg.inv(cov)).swapaxes(1, 2)
        scale = np.ones((len(rows), 2))
        at_step = [np.flatnonzero(step == k) for k in range(n)]

        def errors(poses, lines):
            return [
                innovations(poses[k], anchors[wall[j]], lines[wall[j]], z[j], cov[j]) for k, j in enumerate(at_step)
            ]

        def residuals(x):
            poses, lines = x[: 3 * n].reshape(-1, 3), x[3 * n :].reshape(-1, 2)
            off = poses[0] - self.start
            off[2] = wrap(off[2])
            moved = np.array([compose(inverse(a), b) for a, b in pairwise(poses)]) - self.motions
            moved[:, 2] = wrap(moved[:, 2])
            if form == "shared":
                e = np.concatenate([at.e for at in errors(poses, lines)]) / scale
            else:
                e = z - np.concatenate(
                    [lines_robot(poses[k], anchors[wall[j]], lines[wall[j]]) for k, j in enumerate(at_step)]
                )
                e[:, 0] = wrap(e[:, 0])
                e = np.einsum("mij,mj->mi", weights, e)
            return np.concatenate([prior @ off, (moved @ odometry.T).ravel(), e.ravel()])

        x = np.concatenate([poses.ravel(), lines.ravel()])
        for _ in range(2):  # The noise of a sighting depends a little on the solution.
            R = [at.R for at in errors(x[: 3 * n].reshape(-1, 3), x[3 * n :].reshape(-1, 2))]
            scale = np.sqrt(np.diagonal(np.concatenate(R), axis1=1, axis2=2))
            found = least_squares(residuals, x, method="trf", xtol=1e-13, ftol=1e-13, gtol=1e-13, x_scale="jac")
            x = found.x
        return x[: 3 * n].reshape(-1, 3), x[3 * n :].reshape(-1, 2), np.linalg.inv(found.jac.T @ found.jac)


def look(pose, point, alpha, sigmas, rng):
    """Draw a sighting about a point of a wall: its line, covariance and centre in the robot frame."""
    centre = to_robot(point[None], pose)[0]
    seen = float(wrap(alpha - pose[2]))
    turn = np.array([[1.0, 0.0], [directions(np.array(seen)) @ centre, 1.0]])
    line = np.array([seen, normals(np.array(seen)) @ centre]) + turn @ (sigmas * rng.standard_normal(2))
    return line, (turn * np.square(sigmas)) @ turn.T, centre


def see(backend, ids, lines, cov):
    observed = Observations(np.array(ids, dtype=np.int64), np.array(lines), np.array(cov))
    backend.update(observed, observed)


def everything(backend):
    return backend.belief.joint(backend.belief.ids)


def by_wall(trip, backend):
    """Return the joint of pose and lines in the order of the walls."""
    return backend.belief.joint([trip.ids[i] for i in range(trip.walls)])


def assert_same(a, b, place=MILLIMETRE, angle=HUNDREDTH_DEGREE, cov=0.01):
    """Two joints agree, places to `place` m, angles to `angle` rad, covariances to `cov` of the sigmas."""
    off = a.mean - b.mean
    off[2], off[3::2] = wrap(off[2]), wrap(off[3::2])
    np.testing.assert_allclose(off[[0, 1, *range(4, len(off), 2)]], 0.0, atol=place)
    np.testing.assert_allclose(off[[2, *range(3, len(off), 2)]], 0.0, atol=angle)
    sigma = np.sqrt(np.diag(b.cov))
    np.testing.assert_allclose((a.cov - b.cov) / np.outer(sigma, sigma), 0.0, atol=cov)


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


def test_retracting_a_line_equals_a_run_without_its_sightings():
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
        full.sightings_of(gone)


def test_retracting_a_wrong_match_equals_a_run_without_it():
    trip = Trip.record(9)
    wrong = trip.run(Graph(START, P0))
    wrong.relinearise()
    line, rng = trip.ids[0], np.random.default_rng(1)
    before = everything(wrong)
    sane = len(wrong.sightings_of(line))
    z, cov, _ = look(wrong.belief.pose_world, START[:2], 0.3, (0.01, 0.005), rng)
    see(wrong, [line], [z], [cov])
    wrong_number, step = wrong.sightings_of(line)[-1].tolist()
    assert step == len(trip.seen) - 1
    assert np.abs(everything(wrong).mean - before.mean).max() > 0.01
    wrong.retract_sightings(line, [wrong_number])
    assert len(wrong.sightings_of(line)) == sane
    wrong.relinearise()
    assert_same(everything(wrong), before, place=2e-4, angle=2e-4, cov=0.01)
    with pytest.raises(KeyError):
        wrong.retract_sightings(line, [wrong_number])


def test_a_line_without_any_sighting_left_is_gone():
    trip = Trip.record(10, steps=3)
    backend = trip.run(Graph(START, P0))
    line = next(iter(trip.ids.values()))
    backend.retract_sightings(line, backend.sightings_of(line)[:, 0].tolist())
    assert line not in backend.belief.ids
    everything(backend)


@pytest.mark.parametrize("verb", ["merge", "retract", "retract_sightings", "trajectory", "relinearise", "arrays"])
def test_what_only_a_graph_can_do_makes_beliefs_stale_too(verb):
    trip = Trip.record(11, steps=20)
    backend = trip.run(Graph(START, P0))
    a, b, c = (trip.ids[i] for i in (0, 1, 2))
    belief = backend.belief
    number = int(backend.sightings_of(c)[-1, 0])
    arguments = {"merge": (a, b), "retract": ([a],), "retract_sightings": (c, [number])}.get(verb, ())
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
