"""Faces of a few beams seen again: against Gaussians of the two lines, one pair at a time."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.kernels.existence_kernels import Odds
from chainslam.slam.map.kernels.few_beams_kernels import Same, distances, lines_of, looked, paired
from tests.slam.map.scenes import crossing

few = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
SAME = Same(30.0, 0.5, 0.01)


def drawn(rng, n, off_m=0.1):
    """Return lines about middles near the origin."""
    return np.column_stack(
        [
            rng.uniform(-4.0, 4.0, n),
            rng.uniform(-off_m, off_m, (n, 2)),
            rng.uniform(0.01, 0.3, n),
            rng.uniform(1e-4, 1e-3, n),
            rng.uniform(0.02, 0.1, n),
        ]
    )


def squared(one, other):
    """Return the squared distance of a seen line from a known one, infinite where they are none."""
    turn = np.angle(np.exp(1j * (one[0] - other[0])))
    n, t = np.array([np.cos(other[0]), np.sin(other[0])]), np.array([-np.sin(other[0]), np.cos(other[0])])
    lever, off = t @ (one[1:3] - other[1:3]), n @ (one[1:3] - other[1:3])
    D = np.array([[1.0, 0.0], [lever, 1.0]])
    S = np.diag(one[3:5]) + D @ np.diag(other[3:5]) @ D.T + np.diag([0.0, SAME.slack_m**2])
    d2 = np.array([turn, off]) @ np.linalg.solve(S, [turn, off])
    is_one = abs(lever) < one[5] + other[5] and d2 <= SAME.level and np.cos(turn) >= SAME.least_cosine
    return d2 if is_one else np.inf


def pairs_of(d2):
    """Return the column of each row, -1 for none, the least distances first."""
    pairs: dict[int, int] = {}
    for least in np.sort(d2[np.isfinite(d2)]):
        ((row,), (column,)) = np.nonzero(d2 == least)
        if row not in pairs and column not in pairs.values():
            pairs[int(row)] = int(column)
    return [pairs.get(row, -1) for row in range(len(d2))]


@few
@given(seed=seeds)
def test_a_segment_is_a_line_about_its_middle_where_direction_and_distance_are_independent(seed):
    rng = np.random.default_rng(seed)
    pose, ends = rng.uniform(-3.0, 3.0, 3), rng.uniform(-2.0, 2.0, (4, 2, 2))
    roots = rng.standard_normal((4, 2, 2))
    lines, cov = rng.uniform(0.1, 3.0, (4, 2)), roots @ roots.transpose(0, 2, 1)
    found = lines_of(pose, lines, cov, ends)
    np.testing.assert_allclose(np.exp(1j * found[:, 0]), np.exp(1j * (lines[:, 0] + pose[2])))
    np.testing.assert_allclose(found[:, 1:3], to_world(ends, pose).mean(axis=1))
    np.testing.assert_allclose(found[:, 3], cov[:, 0, 0])
    # What is left of the distance's variance once the direction is known.
    np.testing.assert_allclose(found[:, 4], 1.0 / np.linalg.inv(cov)[:, 1, 1])
    np.testing.assert_allclose(2.0 * found[:, 5], np.linalg.norm(ends[:, 1] - ends[:, 0], axis=1))


@few
@given(seed=seeds)
def test_a_line_is_held_against_another_at_its_own_middle(seed):
    """The known line's distance at the seen middle is that at its own and the lever times its direction."""
    rng = np.random.default_rng(seed)
    seen, known = drawn(rng, 3), drawn(rng, 5)
    expected = [[squared(one, other) for other in known] for one in seen]
    np.testing.assert_allclose(distances(seen, known, SAME), expected, rtol=1e-9)


@few
@given(seed=seeds)
def test_the_nearest_pairs_come_first_and_nothing_is_paired_twice(seed):
    rng = np.random.default_rng(seed)
    d2 = rng.random(rng.integers(0, 6, 2))
    d2[rng.random(d2.shape) < 0.3] = np.inf
    assert paired(d2).tolist() == pairs_of(d2)


@few
@given(seed=seeds)
def test_a_scan_counts_for_the_lines_it_shows_and_against_those_its_beams_reach(seed):
    rng = np.random.default_rng(seed)
    odds, n, bearings = Odds(1.5, -2.0, 4.0, 3, 0.1, 0.2), rng.integers(0, 7), np.linspace(-3.0, 3.0, 90)
    pose, passed = rng.uniform(-0.5, 0.5, 3), rng.uniform(0.0, 1.0, 90)
    known, before, places = drawn(rng, n, 0.5), rng.uniform(-3.0, 4.0, n), rng.uniform(-0.5, 0.5, (n, 2))
    places[rng.random(n) < 0.3] = np.nan
    again = known[rng.permutation(n)[:2]]
    again[:, :3] += rng.normal(0.0, [0.1, 0.01, 0.01], again[:, :3].shape)
    seen = np.concatenate([drawn(rng, 2, 0.5), again])
    after, at = before.copy(), places.copy()
    d2 = np.array([[squared(one, other) for other in known] for one in seen]).reshape(len(seen), n)
    line_of = looked(pose, bearings, passed, seen, known, after, at, SAME, odds)
    assert line_of.tolist() == pairs_of(d2)
    for k, line in enumerate(known):
        rays = [crossing(*beam, pose, line[1:3], line[0]) for beam in zip(bearings, passed, strict=True)]
        reached = sum(abs(along) < line[5] and across >= -0.2 for along, across in rays)
        counts = (k in line_of or reached >= 3) and np.hypot(*(pose[:2] - places[k])) >= 0.1
        change = (1.5 if k in line_of else -2.0) if counts else 0.0
        assert after[k] == min(before[k] + change, 4.0)
        stays = np.full(2, np.inf) if np.isnan(places[k, 0]) else places[k]
        np.testing.assert_array_equal(at[k], pose[:2] if counts else stays)
