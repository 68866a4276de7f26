"""Sums over observations against the plain sums that they stand for."""

from types import SimpleNamespace

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from slam.geometry.poses import wrap
from slam.map.kernels.record_kernels import rows_of
from slam.map.kernels.reliability_kernels import add_directions, add_fits, as_told, may_move, misfits, off_line_cov

few = settings(max_examples=50, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)


def scene(seed):
    """Return observations of five walls, some of them twice, and what is known of the walls."""
    rng = np.random.default_rng(seed)
    m = rng.integers(0, 9)
    root = rng.standard_normal((m, 2, 2))
    known = rng.random((5, 1)) < 0.5
    return SimpleNamespace(
        rows=rng.integers(0, 5, m),
        cov=root @ root.swapaxes(1, 2) + 0.1 * np.eye(2),
        chi2=rng.uniform(0.0, 30.0, m),
        beams=rng.integers(2, 40, m),
        alpha=rng.uniform(-9.0, 9.0, m),
        flags=rng.random((3, m)) < 0.5,
        crooked=rng.random(5) < 0.5,
        first=np.where(known[:, 0], rng.uniform(-3.0, 3.0, 5), np.nan),
        sums=rng.uniform(0.0, 5.0, (5, 2, 2)) * (rng.random((5, 2, 1)) < 0.7),
        residue=np.column_stack([rng.normal(0.0, 2.0, 5), rng.uniform(0.0, 1.0, 5), rng.integers(1, 50, 5)]),
    )


@few
@given(seed=seeds)
def test_each_observation_adds_to_the_sums_of_its_wall(seed):
    one = scene(seed)
    fits, residue, first, sums = np.zeros((5, 2)), np.zeros((5, 3)), one.first.copy(), np.zeros((5, 2, 2))
    add_fits(one.rows, one.cov, one.chi2, one.beams, fits, residue)
    add_directions(one.rows, one.alpha, one.cov, one.flags[0], first, sums)
    for row in range(5):
        ours = np.flatnonzero(one.rows == row)
        dof = one.beams[ours] - 2
        np.testing.assert_allclose(fits[row], [one.chi2[ours].sum(), dof.sum()])
        # What is left of the variance of r where the direction is known, for each beam.
        across = np.array([1.0 / np.linalg.inv(C)[1, 1] for C in one.cov[ours]])
        of_a_beam = across * one.beams[ours]
        excess, by_noise = np.sum((one.chi2[ours] - dof) * of_a_beam), np.sum(2 * dof * of_a_beam**2)
        np.testing.assert_allclose(residue[row], [excess, by_noise, one.beams[ours].sum()], atol=1e-9)
        if not len(ours):
            assert first[row] == one.first[row] or np.isnan(one.first[row])
            continue
        begins = wrap(one.alpha[ours[-1]]) if np.isnan(one.first[row]) else one.first[row]
        assert first[row] == pytest.approx(begins)
        for clear in (0, 1):
            these = ours[one.flags[0, ours] == clear]
            information = 1.0 / one.cov[these, 0, 0]
            turned = np.array([wrap(wrap(alpha) - begins) for alpha in one.alpha[these]])
            np.testing.assert_allclose(sums[row, clear], [information.sum(), np.sum(information * turned)], atol=1e-9)


@few
@given(seed=seeds)
def test_a_wall_is_off_its_line_by_its_residuals_and_by_what_its_directions_differ(seed):
    one = scene(seed)
    across, turned = misfits(one.residue, one.sums, 1.4)
    extents = np.sort(np.random.default_rng(seed).uniform(-2.0, 2.0, (5, 2)), axis=1)
    off = off_line_cov(extents, across, turned, 0.01, 0.2)
    for row in range(5):
        (vague, vague_sum), (clear, clear_sum) = one.sums[row]
        difference = clear_sum / clear - vague_sum / vague if vague > 0.0 and clear > 0.0 else 0.0
        surely = difference != 0.0 and abs(difference) / np.sqrt(1.0 / vague + 1.0 / clear) > 1.4
        excess, by_noise, beams = one.residue[row]
        expected = 4.0 * excess / beams * (excess / np.sqrt(by_noise) > 1.4), surely * difference**2
        np.testing.assert_allclose((across[row], turned[row]), expected, atol=1e-12)
        length = np.ptp(extents[row])
        variance = expected[0] + (0.01 / (1.0 + (length / 0.2) ** 4)) ** 2
        turn = max(12.0 * variance / length**2, expected[1])
        lever = np.array([1.0, extents[row].mean()])
        np.testing.assert_allclose(off[row], turn * np.outer(lever, lever) + np.diag([0.0, variance]), rtol=1e-9)


@few
@given(seed=seeds)
def test_what_may_move_the_estimate_and_how_it_is_told(seed):
    one = scene(seed)
    tentative, clear, _ = one.flags
    directions = 3.0 * one.sums
    found = may_move(tentative, one.cov, clear, one.rows, one.crooked, directions, 1.2)
    straight = []
    for k, row in enumerate(one.rows):
        variance = one.cov[k, 0, 0]
        few = tentative[k] and variance < 1.44 and variance * directions[row, 1, 0] > 1.0
        straight.append(bool((clear[k] or few) and not one.crooked[row]))
    assert found.tolist() == (straight if any(straight) else clear.tolist())
    told = as_told(one.cov, tentative, 0.15)
    for k, C in enumerate(one.cov):
        # Turned about the point where the distance does not depend on the direction.
        lever = np.array([1.0, C[0, 1] / C[0, 0]])
        more = 0.15**2 * np.outer(lever, lever) * (tentative[k] and not tentative.all())
        np.testing.assert_allclose(told[k], C + more, rtol=1e-12)


@given(known=st.sets(st.integers(0, 30)), asked=st.lists(st.integers(-3, 33)))
def test_a_row_is_where_an_id_stands_or_would_stand(known, asked):
    table = np.array(sorted(known), dtype=np.int64)
    rows, all_known = rows_of(table, np.array(asked, dtype=np.int64))
    assert rows.tolist() == [sum(one < wanted for one in known) for wanted in asked]
    assert all_known == known.issuperset(asked)
