"""Faces of a few beams seen again: against Gaussians of the two lines, one pair at a time."""

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.kernels.few_beams_kernels import Same, distances, lines_of, paired

few = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
SAME = Same(30.0, 0.5, 0.01)


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
    seen, known = (
        np.column_stack(
            [
                rng.uniform(-4.0, 4.0, n),
                rng.uniform(-0.1, 0.1, (n, 2)),
                rng.uniform(0.01, 0.3, n),
                rng.uniform(1e-4, 1e-3, n),
                rng.uniform(0.02, 0.1, n),
            ]
        )
        for n in (3, 5)
    )
    found = distances(seen, known, SAME)
    for s, one in enumerate(seen):
        for k, other in enumerate(known):
            turn = np.angle(np.exp(1j * (one[0] - other[0])))
            n, t = np.array([np.cos(other[0]), np.sin(other[0])]), np.array([-np.sin(other[0]), np.cos(other[0])])
            lever, off = t @ (one[1:3] - other[1:3]), n @ (one[1:3] - other[1:3])
            D = np.array([[1.0, 0.0], [lever, 1.0]])
            S = np.diag(one[3:5]) + D @ np.diag(other[3:5]) @ D.T + np.diag([0.0, SAME.slack_m**2])
            squared = np.array([turn, off]) @ np.linalg.solve(S, [turn, off])
            is_one = abs(lever) < one[5] + other[5] and squared <= SAME.level and np.cos(turn) >= SAME.least_cosine
            np.testing.assert_allclose(found[s, k], squared if is_one else np.inf, rtol=1e-9)


@few
@given(seed=seeds)
def test_the_nearest_pairs_come_first_and_nothing_is_paired_twice(seed):
    rng = np.random.default_rng(seed)
    d2 = rng.random(rng.integers(0, 6, 2))
    d2[rng.random(d2.shape) < 0.3] = np.inf
    pairs: dict[int, int] = {}
    for least in np.sort(d2[np.isfinite(d2)]):
        ((row,), (column,)) = np.nonzero(d2 == least)
        if row not in pairs and column not in pairs.values():
            pairs[int(row)] = int(column)
    assert paired(d2).tolist() == [pairs.get(row, -1) for row in range(len(d2))]
