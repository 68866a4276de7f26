"""Where the world lies cannot be seen: which filters know it, and what the others gain from nothing."""

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.backends import BACKENDS, BackendOptions
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.backends.kalman.dense_map import DenseMap
from chainslam.slam.backends.kalman.linear import carry, equality
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.estimation.models import initialise, innovations, move
from chainslam.slam.geometry.poses import J

few = settings(max_examples=20, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
P0 = np.diag([0.1, 0.1, np.deg2rad(2.0)]) ** 2
START = np.array([0.0, -1.0, 0.3])
KEEP = [name for name, entry in BACKENDS.items() if entry.keeps_frame and entry.options is EkfConfig]
DROP = [name for name, entry in BACKENDS.items() if entry.covariance == "blocks"]

pytestmark = pytest.mark.usefixtures("_unchecked")


def of_pose(position):
    """How the pose changes with a shift t and a turn phi of everything: dp = t + J p phi, d_theta = phi."""
    N = np.eye(3)
    N[:2, 2] = J @ position
    return N


def of_lines(alpha, anchors):
    """The same of lines: d_alpha = phi, dd = n·(t + J c phi)."""
    N = np.zeros((len(alpha), 2, 3))
    n = np.stack([np.cos(alpha), np.sin(alpha)], axis=-1)
    N[:, 0, 2] = 1.0
    N[:, 1, :2] = n
    N[:, 1, 2] = np.sum(n * (anchors @ J.T), axis=-1)
    return N


def anything(seed, count=5):
    rng = np.random.default_rng(seed)
    lines = np.stack([rng.uniform(-3, 3, count), rng.uniform(0.5, 4, count)], axis=-1)
    t0 = rng.uniform(-2, 2, count)
    turn = np.tile(np.eye(2), (count, 1, 1))
    turn[:, 1, 0] = t0
    cov = turn @ np.diag([1e-4, 1e-5]) @ turn.swapaxes(1, 2)
    return rng, rng.uniform(-9, 9, 3), rng.uniform(-9, 9, (count, 2)), lines, cov


@few
@given(seed=seeds)
def test_no_measurement_sees_a_shift_or_a_turn_of_everything_wherever_it_is_linearised(seed):
    rng, pose, anchors, lines, cov = anything(seed)
    alpha = lines[:, 0] + pose[2] + rng.uniform(-0.3, 0.3, 5)
    means = np.stack([alpha, rng.uniform(-1, 1, 5)], axis=-1)
    for position, at in ((pose[:2], alpha), (rng.uniform(-9, 9, 2), rng.uniform(-3, 3, 5))):
        model = innovations(pose, anchors, means, lines, cov, position, at)
        seen = model.H_pose @ of_pose(position) + model.H_line @ of_lines(at, anchors)
        np.testing.assert_allclose(seen, 0.0, atol=1e-13)
    exact, plain = (
        innovations(pose, anchors, means, lines, cov, pose[:2], alpha),
        innovations(pose, anchors, means, lines, cov),
    )
    np.testing.assert_array_equal(exact.H_line, plain.H_line)


@few
@given(seed=seeds)
def test_motion_and_initialisation_carry_the_unobservable_directions_on(seed):
    rng, pose, _, lines, _ = anything(seed)
    position = rng.uniform(-9, 9, 2)
    motion = move(pose, rng.uniform(-1, 1, 3), position)
    np.testing.assert_allclose(motion.F @ of_pose(position), of_pose(motion.pose_world[:2]), atol=1e-13)
    for at_wall in (True, False):
        new = initialise(pose, lines, rng.uniform(-3, 3, (5, 2)), at_wall, position)
        carried = new.G_pose @ of_pose(position)
        np.testing.assert_allclose(carried, of_lines(new.means[:, 0], new.anchors), atol=1e-13)


@few
@given(seed=seeds)
def test_carrying_takes_the_unobservable_directions_to_the_new_estimate_and_back_undoes_it(seed):
    rng, pose, anchors, lines, _ = anything(seed)
    there, alpha, turned = rng.uniform(-9, 9, 2), lines[:, 0], rng.uniform(-3, 3, 5)
    by_pose, by_line = carry(pose[:2], there, alpha, turned, anchors)
    N = of_pose(pose[:2])
    np.testing.assert_allclose(N + by_pose @ N, of_pose(there), atol=1e-12)
    np.testing.assert_allclose(of_lines(alpha, anchors) + by_line @ N, of_lines(turned, anchors), atol=1e-12)
    back_pose, back_line = carry(there, pose[:2], turned, alpha, anchors)
    D, back = np.eye(13), np.eye(13)
    D[:3, :3] += by_pose
    D[3:, :3] = by_line.reshape(10, 3)
    back[:3, :3] += back_pose
    back[3:, :3] = back_line.reshape(10, 3)
    np.testing.assert_allclose(back @ D, np.eye(13), atol=1e-11)


@few
@given(seed=seeds)
def test_that_two_lines_are_one_says_nothing_of_where_when_taken_at_one_direction(seed):
    rng = np.random.default_rng(seed)
    means, anchors, alpha = rng.uniform(-2, 2, (2, 2)), rng.uniform(-9, 9, (2, 2)), rng.uniform(-3, 3)
    H, _ = equality(means, anchors, alpha)
    N = np.concatenate([of_pose(rng.uniform(-9, 9, 2)), of_lines(np.full(2, alpha), anchors).reshape(4, 3)])
    np.testing.assert_allclose(H @ N, 0.0, atol=1e-13)


class Recorder(DenseMap):
    """Keeps every linear map that a filter applies to its errors, from when it is told to."""

    def __init__(self, pose_world, pose_cov):
        super().__init__(pose_world, pose_cov)
        self.rows, self.transition = [], None

    def start(self):
        self.transition = np.eye(3 + 2 * len(self.ids))

    def _then(self, part):
        if self.transition is not None:
            self.transition = part @ self.transition

    def move(self, motion, Q):
        super().move(motion, Q)
        if self.transition is not None:
            whole = np.eye(len(self.transition))
            whole[:3, :3] = motion.F
            self._then(whole)

    def shear(self, by_pose, by_line):
        super().shear(by_pose, by_line)
        if self.transition is not None:
            whole = np.eye(len(self.transition))
            whole[:3, :3] += by_pose
            whole[3:, :3] = by_line.reshape(-1, 3)
            self._then(whole)

    def follow(self, moves, common):
        super().follow(moves, common)
        if self.transition is not None:
            self._then(np.eye(len(self.transition)) + moves @ common.T)

    def condition(self, model):
        if self.transition is not None:
            H = np.zeros((len(model.H), len(self.transition)))
            columns = 3 + 2 * model.rows[:, None] + np.arange(2)
            H[:, :3], H[:, columns.ravel()] = model.H[:, :3], model.H[:, 3:]
            self.rows.append(H @ self.transition)
        super().condition(model)


@pytest.mark.parametrize("at_wall", [True, False])
@pytest.mark.parametrize("name", ["full-ekf", *KEEP])
def test_the_observability_matrix_keeps_three_directions_unseen_only_where_jacobians_agree(name, at_wall, make_walls):
    rng, walls = np.random.default_rng(41), make_walls(16, sigmas=(0.01, 0.01))
    make = BACKENDS[name].make
    backend = make(START, P0, BackendOptions(EkfConfig(at_wall=at_wall)))
    recorder = Recorder(START, P0)
    backend.map = recorder
    true = START + np.sqrt(np.diag(P0)) * rng.standard_normal(3)
    ids = backend.grow(*walls.look(true, np.arange(16), rng))
    recorder.start()
    for _ in walls.tour(backend, true, rng, 60, dict(enumerate(ids.tolist()))):
        pass
    values = np.linalg.svd(np.concatenate(recorder.rows), compute_uv=False)
    print(f"{name}, at_wall={at_wall}: smallest singular values {values[-3:]}, largest {values[0]:.0f}")
    assert len(values) == 35
    assert values[-4] > 1e-6 * values[0]
    if name in KEEP:
        assert values[-3] < 1e-9 * values[0]
    else:
        assert values[-1] > 1e-6 * values[0]


def still(name, walls, looks, cov=P0):
    """Stand still and look; return the pose's covariance after each look."""
    rng = np.random.default_rng(42)
    true = START + np.sqrt(np.diag(cov)) * rng.standard_normal(3)
    backend = BACKENDS[name].make(START, cov)
    rows = np.arange(len(walls.lines))
    ids = backend.grow(*walls.look(true, rows, rng))
    covs = []
    for _ in range(looks):
        lines, covariances, _ = walls.look(true, rows, rng)
        seen = Observations(ids, lines, covariances)
        backend.update(seen, seen)
        covs.append(backend.belief.pose_cov)
    return np.array(covs)


@pytest.mark.parametrize("name", KEEP)
def test_standing_still_a_consistent_filter_learns_nothing_of_its_own_place(name, make_walls):
    covs = still(name, make_walls(8), 1000)
    assert np.abs(covs - P0).max() <= 1e-10 * np.trace(P0)


@pytest.mark.parametrize("name", DROP)
def test_standing_still_without_correlations_certainty_comes_from_nothing_as_one_over_n(name, make_walls):
    trace = np.trace(still(name, make_walls(8), 1000), axis1=1, axis2=2)
    n = np.arange(1, 1001)
    slope = np.polyfit(np.log(n[9:]), np.log(trace[9:]), 1)[0]
    print(f"{name}: slope {slope:.3f}, ratios at 10, 100, 1000: {trace[[9, 99, 999]] / np.trace(P0)}")
    assert -1.1 <= slope <= -0.95


@pytest.mark.parametrize("name", ["full-ekf", "relocation-ekf"])
def test_standing_still_the_full_filter_falls_below_its_start_when_the_heading_is_uncertain(name, make_walls):
    ratio = np.trace(still(name, make_walls(8), 1000), axis1=1, axis2=2) / np.trace(P0)
    surer = np.diag([0.01, 0.01, np.deg2rad(0.1)]) ** 2
    small = np.trace(still(name, make_walls(8), 1000, surer), axis1=1, axis2=2) / np.trace(surer)
    print(f"{name}: trace ratio at 10, 100, 1000: {ratio[[9, 99, 999]]}, with the small P0 {small[[9, 99, 999]]}")
    assert ratio[-1] < ratio[9] < 0.9
    assert 0.9 < small[-1] < 1.0


@pytest.mark.parametrize("name", KEEP)
def test_a_pose_is_never_surer_than_its_start_carried_along(name, make_walls):
    """P_k >= A P0 A' with A = [I, J (p_k - p_0); 0, 1], at the positions where the filter is linearised."""
    rng, backend = np.random.default_rng(43), BACKENDS[name].make(START, P0)
    true = START + np.sqrt(np.diag(P0)) * rng.standard_normal(3)
    worst, falls = np.inf, 0
    walls = make_walls(16, sigmas=(1e-5, 1e-5))
    ids = dict(enumerate(backend.grow(*walls.look(true, np.arange(6), rng)).tolist()))
    for _ in walls.tour(backend, true, rng, 150, ids, sigmas=(0.03, 0.02, 0.03)):
        belief = backend.belief
        at = backend._position if name == "fej-ekf" else belief.pose_world[:2]
        A = np.eye(3)
        A[:2, 2] = J @ (at - START[:2])
        worst = min(worst, np.linalg.eigvalsh(belief.pose_cov - A @ P0 @ A.T).min())
        falls += belief.pose_cov[2, 2] < P0[2, 2] * (1 - 1e-9)
    print(f"{name}: smallest eigenvalue of P - A P0 A' over tr P0: {worst / np.trace(P0):.1e}")
    assert worst >= -1e-9 * np.trace(P0)
    assert falls == 0
