"""The weights of hypotheses against all assignments one by one, and what acts against sums over them."""

from itertools import product

import numpy as np
import pytest
from scipy.stats import chi2, multivariate_normal

from chainslam.slam.association.kernels.candidate_kernels import Candidates
from chainslam.slam.association.matchers.joint_assignment import NEW, acting, hypotheses
from chainslam.slam.association.matching import MatchingConfig, limits_of

CONFIG = MatchingConfig(method="assignment")
LIMITS = limits_of(CONFIG)


def scene(rng, segments=3, rivals=2):
    """Return pairs of some segments, each with rivals for its wall, and their joint covariance: all share a turn."""
    segment = np.repeat(np.arange(segments), rivals)
    count = len(segment)
    R = np.tile(np.diag([0.01, 0.01]) ** 2, (count, 1, 1))
    shared = np.kron(np.ones((count, count)), np.diag([0.02, 0.03]) ** 2)
    S = shared + np.kron(np.eye(count), np.diag([0.012, 0.014]) ** 2)
    e = rng.standard_normal(2) * [0.02, 0.03] + rng.standard_normal((count, 2)) * 0.014
    e[1::rivals, 1] += rng.uniform(0.0, 0.1, segments)
    blocks = S.reshape(count, 2, count, 2)[np.arange(count), :, np.arange(count), :]
    d2 = np.einsum("ci,cij,cj->c", e, np.linalg.inv(blocks), e)
    zeros = np.zeros((count, 2, 3))
    return Candidates(segment, np.arange(count), e, zeros, np.zeros((count, 2, 2)), R, d2, -np.ones(count)), S


def log_weight(choice, found, S):
    """Return the logarithm of the weight of one assignment, over that of new walls alone."""
    pairs = [c for c in choice if c != NEW]
    if not pairs:
        return 0.0
    at = np.ravel([[2 * c, 2 * c + 1] for c in pairs])
    told = multivariate_normal(np.zeros(len(at)), S[np.ix_(at, at)]).logpdf(found.e[pairs].ravel())
    return float(told - len(pairs) * np.log(CONFIG.density))


def within_the_gate(choice, found, S):
    """Return whether no pair is farther off, given all others, than the gate allows."""
    pairs = [c for c in choice if c != NEW]
    for c in pairs if len(pairs) > 1 else ():
        own, rest = [2 * c, 2 * c + 1], np.ravel([[2 * k, 2 * k + 1] for k in pairs if k != c])
        gain = S[np.ix_(own, rest)] @ np.linalg.inv(S[np.ix_(rest, rest)])
        left = found.e[c] - gain @ found.e.ravel()[rest]
        cov = S[np.ix_(own, own)] - gain @ S[np.ix_(rest, own)]
        if left @ np.linalg.solve(cov, left) > chi2.ppf(CONFIG.gate, 2):
            return False
    return True


def all_assignments(found, count):
    """Return every assignment, one by one."""
    return list(product(*[[NEW, *np.flatnonzero(found.segment == s)] for s in range(count)]))


@pytest.mark.parametrize("seed", range(20))
def test_hypotheses_weigh_what_their_joint_gaussian_says(seed):
    found, S = scene(np.random.default_rng(seed))
    choices, weights = hypotheses(found, S, np.ones(len(found.e), dtype=bool), 3, LIMITS)
    logs = np.array([log_weight(choice, found, S) for choice in choices.tolist()])
    expected = np.exp(logs - logs.max())
    np.testing.assert_allclose(weights, expected / expected.sum(), rtol=1e-9, atol=1e-12)
    assert len({tuple(choice) for choice in choices.tolist()}) == len(choices)


def test_the_best_of_all_assignments_within_the_gate_is_hardly_ever_missed():
    missed = 0
    for seed in range(100):
        found, S = scene(np.random.default_rng(seed))
        choices, weights = hypotheses(found, S, np.ones(len(found.e), dtype=bool), 3, LIMITS)
        fitting = [choice for choice in all_assignments(found, 3) if within_the_gate(choice, found, S)]
        best = max(log_weight(choice, found, S) for choice in fitting)
        missed += log_weight(choices[weights.argmax()].tolist(), found, S) < best - 1e-9
    assert missed <= 5


def acts(weights, choices, e=((0.0, 0.0), (0.0, 0.1))):
    """Return what acts and what waits of one segment with two walls 0.1 m apart, by these weights."""
    e = np.array(e)
    S = np.kron(np.eye(2), np.diag([0.01, 0.01]) ** 2)
    R = np.zeros((2, 2, 2))
    found = Candidates(np.zeros(2, int), np.arange(2), e, np.zeros((2, 2, 3)), R, R, np.zeros(2), -np.ones(2))
    chosen, waits = acting(found, S, np.array(choices)[:, None], np.array(weights), CONFIG.gate, LIMITS.one_wall)
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
