"""The weights of hypotheses against all assignments one by one, and what acts against sums over them.

And walkers whose wheels slip by as much as a wall bends.
"""

from itertools import product
from typing import NamedTuple

import numpy as np
import pytest
import shapely
from scipy.stats import chi2, multivariate_normal

from slam.association.kernels.hypothesis_kernels import NEW, acting, hypotheses
from slam.association.kernels.rest_kernels import apart, judged_by_the_rest
from slam.association.matching import KnownWalls, MatchingConfig, limits_of, match
from slam.estimation.backend import Joint
from slam.robot import Odometry
from tests.slam.association.test_matching import Walker, faces_of, straight_pieces

CONFIG = MatchingConfig()
LIMITS = limits_of(CONFIG)


class Scene(NamedTuple):
    """Pairs of segments with walls: what they differ by from what is predicted of them, and its covariance."""

    segment: np.ndarray
    e: np.ndarray
    S: np.ndarray

    def hypotheses(self, may_seed=None):
        """Return choices and weights; all pairs may begin one."""
        may_seed = np.ones(len(self.segment), dtype=bool) if may_seed is None else may_seed
        return hypotheses(self.segment, self.e, self.S, may_seed, int(self.segment.max()) + 1, LIMITS)


def scene(rng, segments=3, rivals=2):
    """Return pairs of some segments, each with rivals for its wall, and their joint covariance: all share a turn."""
    segment = np.repeat(np.arange(segments), rivals)
    count = len(segment)
    shared = np.kron(np.ones((count, count)), np.diag([0.02, 0.03]) ** 2)
    S = shared + np.kron(np.eye(count), np.diag([0.012, 0.014]) ** 2)
    e = rng.standard_normal(2) * [0.02, 0.03] + rng.standard_normal((count, 2)) * 0.014
    e[1::rivals, 1] += rng.uniform(0.0, 0.1, segments)
    return Scene(segment, e.ravel(), S)


def conditioned(seen, c, others):
    """Return what is left of the difference of a pair, and its covariance, given some others."""
    own = [2 * c, 2 * c + 1]
    rest = np.ravel([[2 * k, 2 * k + 1] for k in others]).astype(int)
    gain = seen.S[np.ix_(own, rest)] @ np.linalg.inv(seen.S[np.ix_(rest, rest)])
    return seen.e[own] - gain @ seen.e[rest], seen.S[np.ix_(own, own)] - gain @ seen.S[np.ix_(rest, own)]


def log_weight(choice, seen):
    """Return the logarithm of the weight of one assignment, over that of new walls alone."""
    pairs = [c for c in choice if c != NEW]
    if not pairs:
        return 0.0
    at = np.ravel([[2 * c, 2 * c + 1] for c in pairs])
    told = multivariate_normal(np.zeros(len(at)), seen.S[np.ix_(at, at)]).logpdf(seen.e[at])
    return float(told - len(pairs) * np.log(CONFIG.density))


def within_the_gate(choice, seen):
    """Return whether no pair is farther off, given all others, than the gate allows."""
    pairs = [c for c in choice if c != NEW]
    for c in pairs if len(pairs) > 1 else ():
        left, cov = conditioned(seen, c, [k for k in pairs if k != c])
        if left @ np.linalg.solve(cov, left) > chi2.ppf(CONFIG.gate, 2):
            return False
    return True


def all_assignments(seen, count):
    """Return every assignment, one by one."""
    return list(product(*[[NEW, *np.flatnonzero(seen.segment == s)] for s in range(count)]))


@pytest.mark.parametrize("seed", range(20))
def test_hypotheses_weigh_what_their_joint_gaussian_says(seed):
    seen = scene(np.random.default_rng(seed))
    choices, weights = seen.hypotheses()
    logs = np.array([log_weight(choice, seen) for choice in choices.tolist()])
    expected = np.exp(logs - logs.max())
    np.testing.assert_allclose(weights, expected / expected.sum(), rtol=1e-9, atol=1e-12)
    assert len({tuple(choice) for choice in choices.tolist()}) == len(choices)


def test_the_best_of_all_assignments_within_the_gate_is_hardly_ever_missed():
    missed = 0
    for seed in range(100):
        seen = scene(np.random.default_rng(seed))
        choices, weights = seen.hypotheses()
        fitting = [choice for choice in all_assignments(seen, 3) if within_the_gate(choice, seen)]
        best = max(log_weight(choice, seen) for choice in fitting)
        missed += log_weight(choices[weights.argmax()].tolist(), seen) < best - 1e-9
    assert missed <= 5


@pytest.mark.parametrize("seed", range(20))
def test_no_hypothesis_holds_a_pair_outside_the_gate_or_less_likely_than_a_new_wall(seed):
    seen = scene(np.random.default_rng(seed), segments=5, rivals=3)
    choices, _ = seen.hypotheses()
    for choice in choices.tolist():
        assert within_the_gate(choice, seen)
        for s, pair in enumerate(choice):
            without = [*choice[:s], NEW, *choice[s + 1 :]]
            assert pair == NEW or log_weight(choice, seen) > log_weight(without, seen)


def test_a_segment_of_which_a_new_wall_is_likelier_does_not_wait_for_a_known_one():
    """Its wall is known so badly that it fits, and so would anything."""
    sigmas = np.array([0.01, 0.01, 1.0, 3.0])
    seen = Scene(np.arange(2), np.array([0.0, 0.0, 2.0, 0.0]), np.diag(sigmas**2))
    chosen, waits = acting(seen.segment, seen.e, seen.S, np.zeros((2, 2, 2)), *seen.hypotheses(), LIMITS)
    assert chosen.tolist() == [0]
    assert waits.tolist() == [False, False]


def test_segments_of_few_beams_begin_no_hypothesis():
    choices, weights = scene(np.random.default_rng(1)).hypotheses(np.zeros(6, dtype=bool))
    assert choices.tolist() == [[NEW] * 3]
    assert weights.tolist() == [1.0]


@pytest.mark.parametrize("seed", range(20))
def test_observations_are_judged_by_all_others(seed):
    """From the joint Gaussian of random observations that share a pose."""
    rng = np.random.default_rng(seed)
    count = int(rng.integers(2, 8))
    H = rng.standard_normal((2 * count, 3))
    S = H @ np.diag([1.0, 0.5, 0.2]) @ H.T + 0.3 * np.eye(2 * count)
    seen = Scene(np.arange(count), rng.standard_normal(2 * count), S)
    rows = np.flatnonzero(rng.uniform(size=count) < 0.8)
    squared, log_det, distances, log_dets = judged_by_the_rest(rows, seen.e, S)
    at = (2 * rows[:, None] + np.arange(2)).ravel()
    assert squared == pytest.approx(seen.e[at] @ np.linalg.solve(S[np.ix_(at, at)], seen.e[at]))
    assert log_det == pytest.approx(np.linalg.slogdet(S[np.ix_(at, at)])[1])
    for c, distance, own in zip(rows, distances, log_dets, strict=True):
        left, cov = conditioned(seen, c, rows[rows != c])
        assert distance == pytest.approx(left @ np.linalg.solve(cov, left))
        assert own == pytest.approx(np.linalg.slogdet(cov)[1])


@pytest.mark.parametrize("seed", range(20))
def test_two_landmarks_are_apart_by_what_the_map_says_of_both(seed):
    """Where their covariance leaves no doubt in one direction or in both they do not differ there."""
    rng = np.random.default_rng(seed)
    root = rng.standard_normal((4, 4))
    S, R = root @ root.T + 0.2 * np.eye(4), np.tile(0.125 * np.eye(2), (2, 1, 1))
    if seed % 2:
        own = np.diag([0.125, 0.125 + 0.5 * (seed % 4 == 3)])
        S = np.tile(np.round(64.0 * S[:2, :2]) / 64.0, (2, 2)) + np.kron(np.eye(2), own)
    e, D = rng.standard_normal(4), np.hstack([np.eye(2), -np.eye(2)])
    expected = (D @ e) @ np.linalg.pinv(D @ S @ D.T - 2.0 * R[0], hermitian=True, rcond=1e-12) @ (D @ e)
    assert apart(0, 1, e, S, R) == pytest.approx(expected, abs=1e-9)


def acts(weights, choices, e=((0.0, 0.0), (0.0, 0.1))):
    """Return what acts and what waits of one segment with two walls 0.1 m apart, by these weights."""
    S = np.kron(np.eye(2), np.diag([0.01, 0.01]) ** 2)
    told = np.zeros(2, dtype=np.int64), np.ravel(e), S, np.zeros((2, 2, 2))
    chosen, waits = acting(*told, np.array(choices)[:, None], np.array(weights), LIMITS)
    return chosen.tolist(), waits.tolist()


def test_a_pair_that_nearly_all_weight_shares_acts():
    assert acts([0.995, 0.005], [0, 1]) == ([0], [False])


def test_a_pair_with_a_rival_waits():
    assert acts([0.9, 0.1], [0, 1]) == ([], [True])
    assert acts([0.9, 0.1], [0, NEW]) == ([], [True])


def test_a_segment_that_is_of_no_wall_does_not_wait_for_one():
    assert acts([0.995, 0.005], [NEW, 0]) == ([], [False])
    assert acts([0.9, 0.1], [NEW, 0]) == ([], [True])


def test_two_landmarks_of_one_wall_are_no_rivals():
    assert acts([0.6, 0.4], [0, 1], e=((0.0, 0.0), (0.0, 0.01))) == ([0], [False])


def test_a_slip_by_what_a_wall_bends_gives_no_segment_to_its_neighbour():
    """Each of the two pieces alone then fits the other wall; turned back by one slip, both fit their own."""
    for seed in range(60):
        rng = np.random.default_rng(seed)
        drop = 10.0 * np.tan(np.deg2rad(rng.uniform(2.2, 3.2)))
        hall = shapely.Polygon([(-10, 0), (0, 0), (10, -drop), (10, 12), (-10, 12)])
        start = [rng.uniform(-1.5, 1.5), rng.uniform(0.5, 1.2), -np.pi / 2 + rng.uniform(-0.3, 0.3)]
        walker = Walker(faces_of(hall), start, rng)
        for _ in range(6):
            before = walker.scan().map.belief.pose_world[2]
        slip, sigma = np.deg2rad(rng.choice([-1, 1]) * rng.uniform(2.0, 2.8)), np.deg2rad(0.8)
        walker.mapper.predict(Odometry(np.array([0.0, 0.0, slip]), np.diag([1e-6, 1e-6, sigma]) ** 2))
        belief = walker.scan().map.belief
        # Where nothing can be told apart nothing is fused, and the stated sigma says so.
        assert abs(belief.pose_world[2] - before) < 4.0 * np.sqrt(belief.pose_cov[2, 2])


@pytest.mark.parametrize(("slip_sigmas", "is_matched"), [(0.0, True), (3.5, True), (-3.2, True), (8.0, False)])
def test_the_only_wall_in_sight_is_the_same_after_a_slip_that_happens_once_in_a_thousand_steps(slip_sigmas, is_matched):
    """Refused, it would leave the robot to its wheels, and soon come back as a second wall."""
    hall = shapely.box(-30, 0, 30, 40)
    walker = Walker(faces_of(hall), [0.0, 1.0, -1.2], np.random.default_rng(3))
    for _ in range(6):
        walker.scan()
    sigma = np.deg2rad(1.6)
    slip = Odometry(np.array([0.0, 0.0, slip_sigmas * sigma]), np.diag([2e-3, 2e-3, sigma]) ** 2)
    walker.mapper.predict(slip)
    update = walker.scan()
    assert len(update.matches.pairs) == is_matched
    assert len(update.map) == 1 + (not is_matched)


@pytest.mark.parametrize(("sigmas", "is_matched"), [((0.026, 0.005), True), ((0.12, 0.3), False)])
def test_a_robot_that_is_lost_takes_no_wall_beyond_the_gate(sigmas, is_matched):
    """Where it may be anywhere within a metre, a new wall is as likely."""
    far = Scene(np.array([0]), np.array([np.sqrt(12.0) * sigmas[0], 0.0]), np.diag(np.square(sigmas)))
    chosen, _ = acting(far.segment, far.e, far.S, np.zeros((1, 2, 2)), *far.hypotheses(), LIMITS)
    assert (chosen.tolist() == [0]) is is_matched


def test_the_only_wall_in_sight_is_found_where_it_stands_in_the_map_as_two_that_would_be_merged():
    """Half of a hall's wall was entered again, 4 sigmas off: refused, the robot drove along it by odometry alone."""
    walls = KnownWalls(np.array([3, 7]), np.array([[-4.0, 0.1], [-0.1, 4.0]]))
    anchors, sigma = np.array([[0.0, 1.5], [0.0, 1.5]]), np.deg2rad(0.03)
    for turned, matched in ((3.8, 1), (30.0, 0)):
        mean = np.array([0.0, 0.0, 0.0, np.pi / 2, 0.0, np.pi / 2 + turned * sigma, 0.0])
        stated = np.diag([0.003, 0.003, np.deg2rad(1.5), 1e-5, 1e-4, sigma, 1e-4]) ** 2
        joint = Joint(mean, stated, anchors)
        segment = straight_pieces([[[3.0, 1.5], [-3.0, 1.5]]])
        for clear_only in (True, False):
            assert len(match(segment, walls, joint, clear_only=clear_only).pairs) == matched
