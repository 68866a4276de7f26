"""The paper's matching against brute force, pair by pair: the gate, the threshold in metres, and the nearest wins."""

import numpy as np
import pytest
import shapely
from scipy.stats import chi2

from chainslam.slam.association.joint_compatibility import relocate, seen_halfway
from chainslam.slam.association.matching import NO_MATCHES, KnownWalls, MatchingConfig
from chainslam.slam.association.methods import METHODS, Method
from chainslam.slam.association.paper_matching import match_alone, relocate_robot
from chainslam.slam.association.view import View
from chainslam.slam.backends import BACKENDS
from chainslam.slam.config import MapperConfig
from chainslam.slam.estimation.backend import Joint, Observations
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.geometry.poses import wrap
from chainslam.slam.geometry.segment_kernels import segment_distances
from chainslam.slam.mapper import Mapper

PAPER = MatchingConfig(method="paper")
NEAR_M = PAPER.shared.within_m
IDS = np.array([2, 3, 5, 8, 13, 21])


def axes(alpha):
    return np.array([np.cos(alpha), np.sin(alpha)]), np.array([-np.sin(alpha), np.cos(alpha)])


def scene(rng, count=7, correlated=True):
    """Return walls of which two and two lie near each other, and segments seen of some, with all that errs."""
    pose = np.append(rng.uniform(-2, 2, 2), rng.uniform(-3, 3))
    alpha = np.repeat(rng.uniform(-3, 3, 3), 2) + 0.01 * rng.standard_normal(6)
    anchors = np.empty((6, 2))
    for k in range(6):
        n, t = axes(alpha[k])
        anchors[k] = pose[:2] + (2.0 + 0.3 * (k // 2) + 0.02 * rng.standard_normal()) * n + rng.uniform(-1.5, 1.5) * t
    extents = np.stack([-rng.uniform(0.2, 1.0, 6), rng.uniform(0.2, 1.0, 6)], axis=1)
    sigmas = np.array([0.02, 0.02, 0.01, *[0.01, 0.02] * 6])
    mix = np.eye(15) + (0.3 * rng.standard_normal((15, 15)) if correlated else 0.0)
    root = np.diag(sigmas) @ mix
    joint = Joint(np.concatenate([pose, np.stack([wrap(alpha), np.zeros(6)], axis=1).ravel()]), root @ root.T, anchors)
    lines, covs, ends = [], [], []
    for k in rng.integers(0, 6, count):
        n, t = axes(alpha[k])
        off = rng.standard_normal(2) * [0.03, 0.06]
        middle = t @ (anchors[k] - pose[:2]) + rng.uniform(-1.5, 1.5)
        a = wrap(alpha[k] - pose[2] + off[0])
        r = n @ (anchors[k] - pose[:2]) + off[1]
        turn = np.array([[1.0, 0.0], [middle, 1.0]])
        u, v = axes(a)
        lines.append([a, r])
        covs.append(turn @ np.diag([0.01, 0.005]) ** 2 @ turn.T)
        ends.append(r * u + np.outer([middle - 0.3, middle + 0.3], v))
    few = np.zeros(count, dtype=bool)
    beams = np.tile([0, 9], (count, 1))
    apart = np.zeros((count, 2), dtype=bool)
    segments = Segments(
        np.array(lines), np.array(covs), np.array(ends), beams, np.full(count, 10), apart, np.zeros(count), few
    )
    return segments, KnownWalls(IDS, extents), joint


def by_hand(segments, walls, joint, config):
    """Return squared distance and metres apart of each pair, by derivatives taken numerically and by shapely."""
    d2, apart = np.empty((len(segments), 6)), np.empty((len(segments), 6))
    for s in range(len(segments)):
        a, r = segments.lines[s]
        t0 = segments.cov[s, 0, 1] / segments.cov[s, 0, 0]
        for k in range(6):

            def off(x, z, k=k, t0=t0):
                n, _ = axes(x[3])
                turn = wrap(z[0] - (x[3] - x[2]))
                predicted = x[4] + n @ (joint.anchors[k] - x[:2])
                return np.array([turn, z[1] * np.cos(turn) - t0 * np.sin(turn) - predicted])

            columns = np.array([0, 1, 2, 3 + 2 * k, 4 + 2 * k])
            x, z = joint.mean[columns], np.array([a, r])
            H = np.stack([(off(x + h, z) - off(x - h, z)) / 2e-6 for h in 1e-6 * np.eye(5)], axis=1)
            # The direction turns the piece about its centre, and that stays on its beam.
            turn = off(x, z)[0]
            spread = segments.cov[s, 1, 1] - segments.cov[s, 0, 1] * t0
            R = np.diag([segments.cov[s, 0, 0], spread * (np.cos(turn) - t0 * np.sin(turn) / r) ** 2])
            S = H @ joint.cov[np.ix_(columns, columns)] @ H.T + R
            d2[s, k] = off(x, z) @ np.linalg.solve(S, off(x, z))
            n, t = axes(x[3])
            foot = joint.anchors[k] + x[4] * n
            wall = shapely.LineString(foot + np.outer(walls.extents[k], t))
            c, s_ = np.cos(x[2]), np.sin(x[2])
            seen = shapely.LineString(segments.ends[s] @ np.array([[c, s_], [-s_, c]]) + x[:2])
            apart[s, k] = wall.distance(seen)
    return d2, apart


@pytest.mark.parametrize("seed", range(8))
def test_each_segment_takes_the_nearest_wall_that_passes_both_gates(seed):
    rng = np.random.default_rng(seed)
    met = {"far": 0, "gate": 0, "rivals": 0, "shared": 0}
    for _ in range(12):
        segments, walls, joint = scene(rng, correlated=seed % 2 == 0)
        found = match_alone(segments, walls, joint, PAPER)
        d2, apart = by_hand(segments, walls, joint, PAPER)
        level = chi2.ppf(PAPER.gate, 2)
        pairs = {}
        for s in range(len(segments)):
            passing = [k for k in range(6) if d2[s, k] <= level and apart[s, k] <= NEAR_M]
            met["far"] += any(d2[s] <= level) and not passing
            met["gate"] += any(apart[s] <= NEAR_M) and not passing
            met["rivals"] += len(passing) > 1
            if passing:
                pairs[s] = IDS[min(passing, key=lambda k: d2[s, k])]
        met["shared"] += len(set(pairs.values())) < len(pairs)
        assert dict(found.pairs.tolist()) == pairs
        assert found.unmatched.tolist() == [s for s in range(len(segments)) if s not in pairs]
        assert found.refusals.keys() == set(found.unmatched.tolist())
        np.testing.assert_allclose(
            found.distances, [d2[s, list(IDS).index(wall)] for s, wall in pairs.items()], rtol=1e-5, atol=1e-6
        )
        assert not len(found.doubtful)
        clear = match_alone(segments, walls, joint, PAPER, clear_only=True)
        assert np.array_equal(clear.pairs, found.pairs)
    assert all(met.values()), met


def test_there_may_be_no_wall_and_no_segment():
    segments, walls, joint = scene(np.random.default_rng(1))
    empty = KnownWalls(np.zeros(0, dtype=np.int64), np.zeros((0, 2)))
    found = match_alone(segments, empty, joint.take(np.zeros(0, dtype=np.int64)), PAPER)
    assert found.unmatched.tolist() == list(range(len(segments)))
    assert not len(found.pairs)
    assert not len(match_alone(segments.take(np.zeros(0, dtype=np.int64)), walls, joint, PAPER).pairs)


def test_the_robot_alone_is_moved_before_all_is_matched_again():
    segments, walls, joint = scene(np.random.default_rng(4), correlated=False)
    seen = seen_halfway(joint, IDS, match_alone(segments, walls, joint, PAPER).observations(segments))
    moved, both = relocate_robot(joint, seen), relocate(joint, seen)
    assert len(seen.e)
    assert np.array_equal(moved.mean[:3], both.mean[:3])
    assert not np.allclose(moved.mean[:3], joint.mean[:3])
    assert np.array_equal(moved.mean[3:], joint.mean[3:])
    assert np.array_equal(moved.cov[3:, 3:], joint.cov[3:, 3:])
    assert np.array_equal(moved.cov[:3], both.cov[:3])
    np.testing.assert_allclose(moved.cov.T, moved.cov, atol=1e-15)
    assert np.linalg.eigvalsh(moved.cov).min() > 0.0


def test_the_second_matches_replace_the_first_ones():
    segments, walls, joint = scene(np.random.default_rng(4))
    asked = []

    def counting(segments, walls, joint, config, *, clear_only=False):
        asked.append(len(segments))
        return match_alone(segments, walls, joint, config)

    for clear_stay in (False, True):
        view = View(segments, walls, joint, Method(counting, relocate_robot, clear_stay), PAPER)
        clear = view.match_clear()
        again = view.match_again(clear, view.seen(clear.observations(segments)))
        assert asked == [len(segments), len(clear.unmatched) if clear_stay else len(segments)]
        assert len(again.pairs) == len(clear.pairs) > 0
        asked.clear()


def test_the_setting_names_the_method_and_an_oracle_takes_the_place_of_its_matcher_alone():
    def oracle(segments, walls, joint, config, *, clear_only=False):
        return NO_MATCHES

    def method(matching, matcher=None):
        backend = BACKENDS["block-ekf"].make(np.zeros(3), 1e-4 * np.eye(3))
        return Mapper(backend, MapperConfig(matching=matching), matcher=matcher)._method

    assert method(PAPER) == METHODS["paper"] == Method(match_alone, relocate_robot, False)
    assert method(MatchingConfig()) == METHODS["joint"]
    assert method(PAPER, oracle) == Method(oracle, relocate_robot, clear_stay=False, looks_near=False)


def test_distances_of_segments_are_those_of_shapely():
    rng = np.random.default_rng(3)
    one, other = rng.uniform(-1, 1, (40, 2, 2)), rng.uniform(-1, 1, (30, 2, 2))
    right = [[shapely.LineString(a).distance(shapely.LineString(b)) for b in other] for a in one]
    found = segment_distances(one, other)
    np.testing.assert_allclose(found, right, atol=1e-12)
    assert (found == 0.0).any()
    assert (found > 0.0).any()


def test_a_relocation_without_matches_changes_nothing():
    _, _, joint = scene(np.random.default_rng(2))
    none = Observations(np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2, 2)))
    assert np.array_equal(relocate_robot(joint, seen_halfway(joint, IDS, none)).cov, joint.cov)
