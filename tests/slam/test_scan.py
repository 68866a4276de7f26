"""What a scan says of free space: none where one return alone is missing, none where a beam tells nothing."""

import numpy as np
from hypothesis import given
from hypothesis import strategies as st

from slam.robot import Scan

FULL = np.linspace(-np.pi, np.pi, 12, endpoint=False)
PART = np.linspace(-1.0, 1.0, 12)
A_RANGE = st.one_of(st.just(np.inf), st.just(np.nan), st.floats(0.1, 4.0))


def around(ranges, k, full):
    """The beams before and after one; beyond the last of less than a full turn nothing contradicts."""
    return [ranges[n % 12] if full or 0 <= n < 12 else np.inf for n in (k - 1, k + 1)]


@given(st.lists(A_RANGE, min_size=12, max_size=12), st.booleans())
def test_free_space_is_told_by_returns_and_by_beams_whose_neighbours_have_none_either(ranges, full):
    scan = Scan(FULL if full else PART, np.array(ranges), 0.01, 4.0, 0.0)
    assert scan.is_full_turn == full
    for k, here in enumerate(ranges):
        beside = around(ranges, k, full)
        if np.isfinite(here):
            assert scan.passed_m[k] == scan.shown_m[k] == here
            continue
        assert scan.passed_m[k] == (4.0 if here == np.inf and beside == [np.inf, np.inf] else 0.0)
        if np.isfinite(beside).all():
            assert scan.shown_m[k] == min(beside)
        else:
            assert scan.shown_m[k] == (4.0 if here == np.inf else 0.0)


def test_each_beam_has_its_standard_deviation():
    ranges = np.array([1.0, 2.0, np.inf])
    np.testing.assert_array_equal(Scan(PART[:3], ranges, 0.01, 4.0, 0.0).sigmas_m, [0.01, 0.01, 0.01])
    own = np.array([0.01, 0.02, 0.03])
    np.testing.assert_array_equal(Scan(PART[:3], ranges, own, 4.0, 0.0).sigmas_m, own)
    shared = Scan(PART[:3], ranges, own, 4.0, 0.0, 0.02).sigmas_m
    np.testing.assert_allclose(shared, np.sqrt([0.01**2 + 0.02**2, 0.02**2 + 0.04**2, 0.03**2]))
