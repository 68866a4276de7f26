"""What is seen of walls, and what beams contradict, one wall and one beam at a time."""

from itertools import pairwise

import numpy as np
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.kernels.extent_kernels import CORNER, OCCLUDED, kept_piece, note_whole, seen_along, stretch

few = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)


@few
@given(seed=seeds)
def test_what_is_left_of_a_wall_is_the_piece_that_most_beams_end_on(seed):
    rng = np.random.default_rng(seed)
    extent = np.array([-1.0, 2.0])
    through = rng.uniform(-0.9, 1.9, rng.integers(1, 5))
    on = np.round(rng.uniform(-0.9, 1.9, rng.integers(0, 9)), 1)
    bounds = [-1.0, *sorted(through), 2.0]
    pieces = [(np.sum((on >= low) & (on < high)), high - low, low, high) for low, high in pairwise(bounds)]
    _, _, low, high = max(pieces, key=lambda piece: piece[:2])
    inner = on[(on >= low) & (on <= high)]
    expected = [low, high]
    if len(inner) and low > -1.0 and inner.min() - low < 0.5:
        expected[0] = inner.min()
    if len(inner) and high < 2.0 and high - inner.max() < 0.5:
        expected[1] = inner.max()
    np.testing.assert_array_equal(kept_piece(extent, through, on, 0.5), expected)


@few
@given(seed=seeds)
def test_ends_move_out_to_what_is_seen_and_in_to_a_sharper_corner(seed):
    rng = np.random.default_rng(seed)
    m, pose = rng.integers(0, 6), rng.uniform(-2.0, 2.0, 3)
    rows, kinds = rng.integers(-1, 3, m), rng.integers(0, 3, (m, 2))
    anchors, means = rng.uniform(-1.0, 1.0, (3, 2)), rng.uniform(-1.0, 1.0, (3, 2))
    ends, lines = rng.uniform(-2.0, 2.0, (m, 2, 2)), rng.uniform(0.01, 2.0, (m, 2))
    extents = np.where(rng.random((3, 1)) < 0.3, [[np.inf, -np.inf]], np.sort(rng.uniform(-1.0, 1.0, (3, 2)), axis=1))
    spacing, whole = rng.uniform(0.0, 0.5, (3, 2)), rng.integers(0, 4, 3)
    before, expected, apart_before, count = extents.copy(), extents.copy(), spacing.copy(), whole.copy()
    along, apart = seen_along(ends, lines, rows, pose, anchors, means, 0.03)
    for k, row in enumerate(rows):
        if row < 0:
            continue
        for side in (0, 1):
            t = np.array([-np.sin(means[row, 0]), np.cos(means[row, 0])])
            np.testing.assert_allclose(along[k, side], t @ (to_world(ends[k, side], pose) - anchors[row]), atol=1e-12)
            far = np.linalg.norm(ends[k, side])
            np.testing.assert_allclose(apart[k, side], 0.03 * far / np.clip(lines[k, 1] / far, 0.05, 1.0))
            outwards = (along[k, side] - expected[row, side]) * (1 if side else -1)
            sharper = kinds[k, side] == CORNER and apart[k, side] < apart_before[row, side]
            if outwards > 0.0 or (sharper and -outwards < apart_before[row, side]):
                expected[row, side], apart_before[row, side] = along[k, side], apart[k, side]
    stretch(rows, along, apart, kinds, extents, spacing)
    np.testing.assert_array_equal(extents, expected)
    np.testing.assert_array_equal(spacing, apart_before)
    note_whole(before, rows, kinds, extents, whole, 0.1)
    for row in range(3):
        seen_whole = np.sum(np.all(kinds[rows == row] != OCCLUDED, axis=1))
        with np.errstate(invalid="ignore"):
            grown = np.any(np.abs(extents[row] - before[row]) > 0.1)
        assert whole[row] == (0 if grown else count[row]) + seen_whole
