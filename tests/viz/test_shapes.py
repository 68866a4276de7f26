import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.geometry.lines import normals
from chainslam.viz.shapes import Changes, ellipses, hessian_cov, rounded, spread, with_gaps

seeds = st.integers(0, 2**32 - 1)


def random_cov(rng, n):
    root = rng.normal(size=(n, 2, 2))
    return root @ np.swapaxes(root, 1, 2) + 0.1 * np.eye(2)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_every_point_of_an_ellipse_lies_three_sigmas_out_and_enlarging_moves_it_out(seed):
    rng = np.random.default_rng(seed)
    covs, centres = random_cov(rng, 4), rng.normal(size=(4, 2))
    for times in (1.0, 10.0):
        off = (ellipses(centres, covs, times) - centres[:, None]) / times
        squared = np.einsum("nvi,nij,nvj->nv", off, np.linalg.inv(covs), off)
        np.testing.assert_allclose(squared, 9.0, rtol=1e-9)


def test_a_covariance_that_lost_a_direction_draws_as_a_line():
    flat = ellipses(np.zeros((1, 2)), np.array([[[1.0, 1.0], [1.0, 1.0 - 1e-15]]]), 1.0)
    np.testing.assert_allclose(flat[..., 0], flat[..., 1], atol=1e-6)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_the_covariance_of_alpha_and_r_is_that_of_finite_differences(seed):
    rng = np.random.default_rng(seed)
    alpha, d, anchor = rng.uniform(-3, 3, 1), rng.normal(size=1), rng.normal(size=(1, 2))
    cov = random_cov(rng, 1)

    def line(a, b):
        return np.array([a[0], (b + np.sum(normals(a) * anchor, axis=-1))[0]])

    h = 1e-6
    jacobian = np.column_stack(
        [(line(alpha + h, d) - line(alpha - h, d)) / (2 * h), (line(alpha, d + h) - line(alpha, d - h)) / (2 * h)]
    )
    np.testing.assert_allclose(hessian_cov(alpha, anchor, cov)[0], jacobian @ cov[0] @ jacobian.T, atol=1e-7)


@given(seeds)
@settings(max_examples=20, deadline=None)
def test_only_what_changed_is_drawn_again_however_the_rows_are_cut_into_blocks(seed):
    rng = np.random.default_rng(seed)
    ids, values = rng.integers(0, 4, 40), rng.integers(0, 2, (40, 3))
    last, expected = {}, []
    for thing, value in zip(ids.tolist(), values.tolist(), strict=True):
        expected.append(last.get(thing) != value)
        last[thing] = value
    changes, found = Changes(3), []
    for part in np.split(np.arange(40), np.sort(rng.integers(0, 40, 3))):
        found += changes.among(ids[part], values[part]).tolist()
    assert found == expected


def test_what_was_forgotten_is_drawn_again():
    changes = Changes(1)
    assert changes.among(np.array([7]), np.array([[1]])).all()
    assert not changes.among(np.array([7]), np.array([[1]])).any()
    changes.forget(np.array([7]))
    assert changes.among(np.array([7]), np.array([[1]])).all()


def test_rounding_gives_a_row_for_each_thing():
    assert rounded(np.array([[[0.001, 0.014]]]), 0.005).tolist() == [[0, 3]]


def test_labels_of_one_group_are_raised_until_they_stand_apart():
    heights, groups = np.array([1.0, 0.0, 5.0, 0.1, 0.9]), np.array([0, 0, 0, 1, 1])
    np.testing.assert_allclose(spread(heights, groups, 0.5), heights)
    np.testing.assert_allclose(spread(heights, np.zeros(5, dtype=int), 0.5), [1.5, 0.0, 5.0, 0.5, 1.0])
    assert spread(np.zeros(0), np.zeros(0, dtype=int), 0.5).shape == (0,)


def test_a_path_has_a_gap_where_the_robot_was_carried():
    path = np.arange(12.0).reshape(4, 3)
    assert with_gaps(path, None) is path
    broken = with_gaps(path, np.array([False, True, False, True]))
    assert np.flatnonzero(np.isnan(broken).all(axis=1)).tolist() == [1, 4]
    np.testing.assert_array_equal(broken[np.isfinite(broken[:, 0])], path)
