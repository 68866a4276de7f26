"""Which pairs agree: against brute force, and where the wheels slip by as much as a wall bends."""

from typing import NamedTuple

import numpy as np
import pytest
import shapely
from scipy.stats import multivariate_normal

from chainslam.slam.association.kernels.hypothesis_kernels import agree
from chainslam.slam.association.kernels.rest_kernels import compatible, nearest_alone
from chainslam.slam.association.matching import KnownWalls, match
from chainslam.slam.estimation.backend import Joint
from chainslam.slam.estimation.gates import gate_level
from chainslam.slam.robot import Odometry
from tests.slam.association.test_matching import Walker, faces_of, straight_pieces


class Together(NamedTuple):
    """What m observations differ by from what is predicted of them, and its covariance."""

    e: np.ndarray
    S: np.ndarray

    def take(self, rows):
        at = (2 * rows[:, None] + np.arange(2)).ravel()
        return Together(self.e[at], self.S[at[:, None], at])


def observations(rng, segment, noise=0.3):
    """Return random candidates, correlated through a pose of 3 and 2 numbers of each line, as joint observations."""
    count = len(segment)
    H = rng.standard_normal((2 * count, 3))
    S = H @ np.diag([1.0, 0.5, 0.2]) @ H.T + noise * np.eye(2 * count)
    e = np.linalg.cholesky(S) @ rng.standard_normal(2 * count) + rng.choice([0.0, 3.0], 2 * count)
    return Together(e, S)


def conditioned(seen, c, seed):
    """Return the squared distance of one observation given another, from the joint Gaussian of both."""
    both = seen.take(np.array([seed, c]))
    joint = both.e @ np.linalg.solve(both.S, both.e)
    alone = seen.take(np.array([seed]))
    return joint - alone.e @ np.linalg.solve(alone.S, alone.e)


def likelihood(seen, c):
    """Return the density, per rad m, of the observation of one wall where it was seen."""
    one = seen.take(np.array([c]))
    return multivariate_normal(np.zeros(2), one.S).pdf(one.e)


def together(seen, pairs):
    """Return the squared distance of some observations taken together."""
    some = seen.take(np.array(pairs, dtype=np.int64))
    return some.e @ np.linalg.solve(some.S, some.e)


def hypotheses(segment, seen, seeds, gate, doubt, density):
    """Return cost and choice (candidate by segment) of each hypothesis that may win, one candidate at a time."""
    found = []
    for seed in seeds:
        if together(seen, [seed]) > doubt:
            continue
        choice = {segment[seed]: seed}
        for s in set(segment.tolist()) - {segment[seed]}:
            costs = {c: conditioned(seen, c, seed) for c in np.flatnonzero(segment == s)}
            best = min(costs, key=costs.get)
            if costs[best] <= gate:
                choice[s] = best
        while len(choice) > 1:
            pairs = list(choice.values())
            without = {s: together(seen, [c for c in pairs if c != own]) for s, own in choice.items()}
            worst = min(without, key=without.get)
            if together(seen, pairs) - without[worst] <= doubt:
                break
            del choice[worst]
        pairs = list(choice.values())
        own = together(seen, pairs[:1])
        if len(pairs) > 1 or own <= gate or likelihood(seen, pairs[0]) > density:
            missing = len(set(segment.tolist())) - len(pairs)
            found.append((together(seen, pairs) + doubt * missing, choice))
    return found


@pytest.mark.parametrize("seed", range(30))
def test_the_cheapest_hypothesis_of_all_is_found_and_its_margin(seed):
    rng = np.random.default_rng(seed)
    segment = np.sort(rng.integers(0, 5, rng.integers(1, 12)))
    line = np.concatenate([rng.permutation(12)[: np.count_nonzero(segment == s)] for s in np.unique(segment)])
    seen, may_seed = observations(rng, segment), rng.uniform(size=len(segment)) < 0.8
    levels = gate_level(0.99, 2), gate_level(0.999999, 2)
    pairs, margins = agree(segment, line, *seen, may_seed, *levels, 1e-3)
    found = hypotheses(segment, seen, np.flatnonzero(may_seed), *levels, 1e-3)
    if not found:
        assert not len(pairs)
        return
    least, choice = min(found, key=lambda one: one[0])
    assert pairs.tolist() == [choice[s] for s in sorted(choice)]
    for pair, margin in zip(pairs, margins, strict=True):
        s = segment[pair]
        others = [cost for cost, other in found if s in other and line[other[s]] != line[pair]]
        np.testing.assert_allclose(margin, min(others, default=np.inf) - least, atol=1e-9)


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


def test_a_robot_that_is_lost_takes_no_wall_beyond_the_gate():
    """Where it may be anywhere within a metre, a new wall is as likely."""
    far = np.sqrt(12.0)
    for sigmas, kept in (((0.026, 0.005), 1), ((0.12, 0.3), 0)):
        S = np.diag(np.square(sigmas))
        e, one, levels = np.array([far * sigmas[0], 0.0]), np.array([0]), (gate_level(0.99, 2), gate_level(0.999999, 2))
        pairs, _ = agree(one, one, e, S, np.array([True]), *levels, 0.1)
        assert len(pairs) == kept


def alone(d2, between, cov_between):
    """Return what is matched of one segment with two candidates, by their distances and what the map says of both."""
    e = np.array([0.0, 0.0, between, 0.0])
    S = np.kron(np.array([[1.0, 1.0], [1.0, 1.0]]), np.eye(2)) + 0.1 * np.eye(4)
    S[2:, 2:] += cov_between * np.eye(2)
    R = np.tile(0.05 * np.eye(2), (2, 1, 1))
    return nearest_alone(np.zeros(2, dtype=np.int64), np.array(d2), e, S, R, gate_level(0.99, 2), 9.0).tolist()


def test_a_lone_segment_between_two_walls_belongs_to_neither_but_to_the_nearer_of_two_entries_of_one():
    assert alone([1.0, 2.0], between=1.0, cov_between=1e-4) == []
    assert alone([2.0, 1.0], between=1.0, cov_between=1e-4) == []
    assert alone([1.0, 2.0], between=0.01, cov_between=1e-2) == [0]
    assert alone([2.0, 1.0], between=0.01, cov_between=1e-2) == [1]
    assert alone([1.0, 12.0], between=1.0, cov_between=1e-4) == [0]


@pytest.mark.parametrize("seed", range(20))
def test_each_segment_has_its_nearest_wall_unless_another_is_nearly_as_near(seed):
    """Of some pairs the covariance leaves no doubt in one direction or in both: there they do not differ."""
    rng = np.random.default_rng(seed)
    segment = np.sort(rng.integers(0, 5, rng.integers(1, 14)))
    count = len(segment)
    root = rng.standard_normal((2 * count, 4))
    S, R = root @ root.T + 0.2 * np.eye(2 * count), np.tile(0.125 * np.eye(2), (count, 1, 1))
    if seed % 2:
        own = np.diag([0.125, 0.125 + 0.5 * (seed % 4 == 3)])
        S = np.tile(np.round(64.0 * S[:2, :2]) / 64.0, (count, count)) + np.kron(np.eye(count), own)
    e, d2 = rng.standard_normal(2 * count), rng.uniform(0.0, 12.0, count)
    chosen, expected = nearest_alone(segment, d2, e, S, R, 1.0, 5.0), []
    for s in np.unique(segment):
        rows = np.flatnonzero(segment == s)
        best = rows[np.argmin(d2[rows])]
        rivals = []
        for c in rows[rows != best]:
            D = np.zeros((2, 2 * count))
            D[:, 2 * c : 2 * c + 2], D[:, 2 * best : 2 * best + 2] = np.eye(2), -np.eye(2)
            apart = (D @ e) @ np.linalg.pinv(D @ S @ D.T - 2.0 * R[c], hermitian=True, rcond=1e-12) @ (D @ e)
            if apart > 1.0 and d2[c] < d2[best] + 5.0:
                rivals.append(c)
        if not rivals:
            expected.append(best)
    assert chosen.tolist() == expected


@pytest.mark.parametrize("seed", range(20))
def test_the_worst_are_dropped_until_each_agrees_with_the_rest_and_all_together(seed):
    rng = np.random.default_rng(seed)
    seen = observations(rng, np.arange(rng.integers(1, 9)))
    rows = np.flatnonzero(rng.uniform(size=len(seen.e) // 2) < 0.8)
    levels = np.array([0.0, *(gate_level(0.99, 2 * pairs) for pairs in range(1, 9))])
    kept = rows.tolist()
    while len(kept) > 1:
        all_of_them = together(seen, kept)
        losses = [all_of_them - together(seen, [k for k in kept if k != one]) for one in kept]
        if all_of_them <= levels[len(kept)] and max(losses) <= gate_level(0.9, 2):
            break
        del kept[int(np.argmax(losses))]
    assert compatible(rows, *seen, gate_level(0.9, 2), levels).tolist() == kept


def test_the_only_wall_in_sight_is_found_where_it_stands_in_the_map_as_two_that_would_be_merged():
    """Half of a hall's wall was entered again, 4 sigmas off: refused, the robot drove along it by odometry alone."""
    walls = KnownWalls(np.array([3, 7]), np.array([[-4.0, 0.1], [-0.1, 4.0]]))
    anchors, sigma = np.array([[0.0, 1.5], [0.0, 1.5]]), np.deg2rad(0.03)
    for turned, matched in ((3.8, 1), (30.0, 0)):
        mean = np.array([0.0, 0.0, 0.0, np.pi / 2, 0.0, np.pi / 2 + turned * sigma, 0.0])
        stated = np.diag([0.003, 0.003, np.deg2rad(1.5), 1e-5, 1e-4, sigma, 1e-4]) ** 2
        joint = Joint(mean, stated, anchors)
        segment = straight_pieces([[[3.0, 1.5], [-3.0, 1.5]]])
        found = match(segment, walls, joint, clear_only=True)
        assert not len(found.pairs)
        found = match(segment, walls, joint)
        assert len(found.pairs) == matched
