"""Which ends are near and which are joined: against all pairs, one after another."""

from itertools import pairwise

import networkx as nx
import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.map.kernels.chain_kernels import (
    HEAD,
    TAIL,
    Reach,
    joinable,
    linked,
    near_ends,
    runs,
    successors,
)

few = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)
REACH = Reach(0.3, 0.8)


def walls(seed, count=14):
    """Return the ends of walls, many of which are near, and their lines."""
    rng = np.random.default_rng(seed)
    n = rng.integers(0, count)
    alpha = rng.choice([0.0, 0.2, 1.5, 3.0], n) + rng.normal(0.0, 0.05, n)
    along = np.stack([-np.sin(alpha), np.cos(alpha)], axis=-1)
    start = np.round(rng.uniform(-1.0, 1.0, (n, 2)), 1)
    ends = np.stack([start, start + rng.uniform(0.1, 1.0, (n, 1)) * along], axis=1)
    return ends, np.column_stack([alpha, np.sum(start * np.stack([np.cos(alpha), np.sin(alpha)], -1), axis=1)])


@few
@given(seed=seeds)
def test_the_nearest_ends_are_joined_first_among_all_pairs(seed):
    rng = np.random.default_rng(seed)
    ends, _ = walls(seed)
    n = len(ends)
    gap = np.linalg.norm(ends[:, None, HEAD] - ends[None, :, TAIL], axis=-1)
    expected = [[h, t] for h in range(n) for t in range(n) if h != t and gap[h, t] <= 0.6]
    pairs = near_ends(ends, 0.6)
    assert pairs.tolist() == expected
    allowed, gaps = rng.random(len(pairs)) < 0.7, np.round(gap[tuple(pairs.T)], 1)
    joined = {}
    for k in sorted(np.flatnonzero(allowed), key=lambda k: (gaps[k], *pairs[k])):
        if pairs[k, 0] not in joined and pairs[k, 1] not in joined.values():
            joined[int(pairs[k, 0])] = int(pairs[k, 1])
    assert successors(pairs, gaps, allowed, n).tolist() == [joined.get(row, -1) for row in range(n)]


@few
@given(seed=seeds)
def test_ends_are_joined_that_are_near(seed):
    rng = np.random.default_rng(seed)
    ends, _ = walls(seed)
    pairs = near_ends(ends, 0.9)
    aside = rng.random(len(pairs)) < 0.5
    gaps, allowed = joinable(pairs, ends, aside, REACH)
    for k, (head, tail) in enumerate(pairs):
        gap = np.linalg.norm(ends[tail, TAIL] - ends[head, HEAD])
        assert allowed[k] == (gap <= (0.8 if aside[k] else 0.3))
        np.testing.assert_allclose(gaps[k], gap)


@few
@given(seed=seeds)
def test_runs_are_the_connected_parts_of_the_links(seed):
    rng = np.random.default_rng(seed)
    n = int(rng.integers(1, 12))
    successor, after = np.full(n, -1), rng.permutation(n)
    linked = rng.random(n) < 0.7
    successor[linked] = after[linked]
    successor[successor == np.arange(n)] = -1
    rows, starts, closed = runs(successor)
    links = nx.DiGraph([(row, int(successor[row])) for row in range(n) if successor[row] >= 0])
    links.add_nodes_from(range(n))
    parts = sorted(nx.weakly_connected_components(links), key=min)
    assert [set(rows[i:j].tolist()) for i, j in pairwise(starts)] == parts
    for (i, j), is_closed in zip(pairwise(starts), closed, strict=True):
        run = rows[i:j].tolist()
        assert successor[run[:-1]].tolist() == run[1:]
        assert (successor[run[-1]] == run[0]) == is_closed
        assert not is_closed or run[0] == min(run)


@few
@given(seed=seeds)
def test_linked_walls_meet_where_their_lines_cross_near_both_ends_or_amid_these(seed):
    ends, lines = walls(seed)
    aside = np.random.default_rng(seed).random((len(ends), 2)) < 0.5
    anchors = np.random.default_rng(seed).normal(size=(len(ends), 2))
    offsets = np.sum(anchors * np.column_stack([np.cos(lines[:, 0]), np.sin(lines[:, 0])]), axis=1)
    means = np.column_stack([lines[:, 0], lines[:, 1] - offsets])
    walked, starts, closed, corners = linked(ends, anchors, means, aside, 0.9, 0.5, REACH)
    for (i, j), is_closed in zip(pairwise(starts), closed, strict=True):
        for one, other, corner in zip(walked[i:j], np.roll(walked[i:j], -1), corners[i:j], strict=True):
            if one == walked[j - 1] and not is_closed:
                assert np.isnan(corner).all()
                continue
            met = np.array([ends[one, HEAD], ends[other, TAIL]])
            assert np.hypot(*(met[1] - met[0])) <= (0.8 if aside[one, HEAD] and aside[other, TAIL] else 0.3)
            alpha, expected = lines[[one, other], 0], met.mean(axis=0)
            if abs(np.sin(alpha[1] - alpha[0])) >= 0.05:
                crossing = np.linalg.solve(np.column_stack([np.cos(alpha), np.sin(alpha)]), lines[[one, other], 1])
                expected = crossing if np.hypot(*(met - crossing).T).max() <= 0.5 else expected
            np.testing.assert_allclose(corner, expected, atol=1e-9)
