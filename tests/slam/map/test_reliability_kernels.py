"""Sums over observations against the plain sums that they stand for."""

from types import SimpleNamespace

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.map.kernels.record_kernels import rows_of
from chainslam.slam.map.kernels.reliability_kernels import add_lengths, as_told, lack_of_fit, off_line_cov, off_lines

few = settings(max_examples=50, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)


def scene(seed):
    """Return observations of five walls, some of them twice, and what is known of the walls."""
    rng = np.random.default_rng(seed)
    m = rng.integers(0, 9)
    root = rng.standard_normal((m, 2, 2))
    return SimpleNamespace(
        rows=rng.integers(-1, 5, m),
        cov=root @ root.swapaxes(1, 2) + 0.1 * np.eye(2),
        ends=rng.uniform(-1.0, 1.0, (m, 2, 2)),
        tentative=rng.random(m) < 0.5,
    )


def edge(variance, over_m, middle):
    """Return the covariance of a line that is off across itself by so much, its middle so far along it."""
    lever = np.array([1.0, middle])
    return 12.0 * variance / max(over_m, 1e-3) ** 2 * np.outer(lever, lever) + np.diag([0.0, variance])


def off_by(extent, longest, across, drawn):
    """Return how far a wall may be from its line, an edge of which is off by 0.01 m, a face of 0.2 m by half of it."""
    length = min(np.ptp(extent), min(seen for seen in longest if seen > 0.0))
    short = (0.01 / (1.0 + (length / 0.2) ** 4)) ** 2
    return edge(short, length, extent.mean()) + edge(across, np.ptp(drawn), drawn.mean())


def broken_walls(seed):
    """Return extents of six walls and what is known of their breaks: a step, a turn, both or none."""
    rng = np.random.default_rng(seed)
    extents, seen = np.sort(rng.uniform(-2.0, 2.0, (2, 6, 2)), axis=2)
    breaks = rng.normal(0.0, 0.1, (6, 2)) * (rng.random((6, 2)) < 0.7)
    return rng, extents, np.column_stack([rng.uniform(-2.0, 2.0, 6), breaks, seen])


def misfit(broken, extent):
    """Return over what the line of a wall was drawn, and its misfit: by quadrature over its two faces, m^2."""
    place, step, turn, first, last = broken
    low, high = min(first, extent[0]), max(last, extent[1])
    if not low < place < high:
        return np.array([low, high]), 0.0
    x, weights = np.polynomial.legendre.leggauss(3)
    half = 0.5 * np.diff([low, place, high])[:, None]
    at, weight = (np.array([[low], [place]]) + half * (1.0 + x)).ravel(), (half * weights).ravel()
    faces = step * (at > place) + turn * np.maximum(at - place, 0.0)
    off = faces - np.polynomial.Polynomial.fit(at, faces, 1, w=np.sqrt(weight))(at)
    return np.array([low, high]), 4.0 * weight @ off**2 / (high - low)


@few
@given(seed=seeds)
def test_the_two_longest_pieces_that_were_seen_of_each_wall(seed):
    one = scene(seed)
    longest = np.zeros((5, 2))
    add_lengths(one.rows, one.cov, one.ends, longest)
    for row in range(5):
        ours = np.flatnonzero(one.rows == row)
        lengths = np.linalg.norm(one.ends[ours, 1] - one.ends[ours, 0], axis=1)
        np.testing.assert_allclose(longest[row], np.sort([0.0, 0.0, *lengths])[-2:])


@few
@given(seed=seeds)
def test_a_wall_is_off_its_line_by_its_misfit_and_where_it_is_short(seed):
    rng = np.random.default_rng(seed)
    across = rng.uniform(0.0, 1.0, 5) * (rng.random(5) < 0.7)
    extents = np.sort(rng.uniform(-2.0, 2.0, (5, 2)), axis=1)
    longest = np.sort(rng.uniform(0.01, 2.0, (5, 2)) * (rng.random((5, 2)) < [0.7, 1.0]), axis=1)
    drawn = extents + rng.uniform(0.0, 1.0, (5, 2)) * [-1.0, 1.0]
    off = off_line_cov(extents, longest, across, drawn, 0.01, 0.2)
    for row in range(5):
        np.testing.assert_allclose(off[row], off_by(extents[row], longest[row], across[row], drawn[row]), rtol=1e-9)


@few
@given(seed=seeds)
def test_a_broken_wall_is_off_its_line_by_the_misfit_of_its_faces(seed):
    rng, extents, broken = broken_walls(seed)
    longest = np.sort(rng.uniform(0.01, 2.0, (6, 2)) * (rng.random((6, 2)) < [0.7, 1.0]), axis=1)
    crooked, off = off_lines(extents, longest, broken, 0.01, 0.2)
    for row, (low, high) in enumerate(extents):
        assert crooked[row] == (broken[row, 1:3].any() and low < broken[row, 0] < high)
        drawn, across = misfit(broken[row], extents[row])
        np.testing.assert_allclose(off[row], off_by(extents[row], longest[row], across, drawn), rtol=1e-6, atol=1e-15)


@few
@given(seed=seeds)
def test_a_segment_lacks_fit_by_the_misfit_of_its_wall_about_its_own_middle(seed):
    rng, extents, broken = broken_walls(seed)
    lines, ends = rng.uniform(-3.0, 3.0, (6, 2)), rng.uniform(-2.0, 2.0, (6, 2, 2))
    for row, found in enumerate(lack_of_fit(lines, ends, broken, extents)):
        drawn, across = misfit(broken[row], extents[row])
        middle = ends[row].mean(axis=0) @ [-np.sin(lines[row, 0]), np.cos(lines[row, 0])]
        np.testing.assert_allclose(found, edge(across, np.ptp(drawn), middle), rtol=1e-6, atol=1e-15)


@few
@given(seed=seeds)
def test_beside_others_what_few_beams_show_may_be_turned(seed):
    one = scene(seed)
    told = as_told(one.cov, one.tentative, 0.15)
    for k, C in enumerate(one.cov):
        # Turned about the point where the distance does not depend on the direction.
        lever = np.array([1.0, C[0, 1] / C[0, 0]])
        more = 0.15**2 * np.outer(lever, lever) * (one.tentative[k] and not one.tentative.all())
        np.testing.assert_allclose(told[k], C + more, rtol=1e-12)


@given(known=st.sets(st.integers(0, 30)), asked=st.lists(st.integers(-3, 33)))
def test_a_row_is_where_an_id_stands_or_would_stand(known, asked):
    table = np.array(sorted(known), dtype=np.int64)
    rows, all_known = rows_of(table, np.array(asked, dtype=np.int64))
    assert rows.tolist() == [sum(one < wanted for one in known) if wanted >= 0 else -1 for wanted in asked]
    assert all_known == known.issuperset(wanted for wanted in asked if wanted >= 0)
