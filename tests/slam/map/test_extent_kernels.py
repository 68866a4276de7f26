"""What is seen of walls, and what beams contradict, one wall and one beam at a time."""

from itertools import pairwise

import numpy as np
import shapely
from hypothesis import given, settings
from hypothesis import strategies as st

from chainslam.slam.geometry.poses import to_world
from chainslam.slam.map.kernels.extent_kernels import (
    contradict,
    kept_piece,
    seen_along,
    stretch,
)
from tests.slam.map.scenes import crossing

few = settings(max_examples=60, deadline=None, derandomize=True)
seeds = st.integers(0, 2**32)


def left_of(extent, through, on, trim_m):
    """Return what is left of a wall between the beams that pass through it, some others of which end on it."""
    bounds = [extent[0], *sorted(through), extent[1]]
    pieces = [(np.sum((on >= low) & (on < high)), high - low, low, high) for low, high in pairwise(bounds)]
    _, _, low, high = max(pieces, key=lambda piece: piece[:2])
    inner = on[(on >= low) & (on <= high)]
    kept = [low, high]
    if len(inner) and low > extent[0] and inner.min() - low < trim_m:
        kept[0] = inner.min()
    if len(inner) and high < extent[1] and high - inner.max() < trim_m:
        kept[1] = inner.max()
    return kept


@few
@given(seed=seeds)
def test_what_is_left_of_a_wall_is_the_piece_that_most_beams_end_on(seed):
    rng = np.random.default_rng(seed)
    extent = np.array([-1.0, 2.0])
    through = rng.uniform(-0.9, 1.9, rng.integers(1, 5))
    on = np.round(rng.uniform(-0.9, 1.9, rng.integers(0, 9)), 1)
    np.testing.assert_array_equal(kept_piece(extent, through, on, 0.5), left_of(extent, through, on, 0.5))


@few
@given(seed=seeds)
def test_ends_move_out_to_what_is_seen_and_in_to_a_sharper_corner(seed):
    rng = np.random.default_rng(seed)
    m, pose = rng.integers(0, 6), rng.uniform(-2.0, 2.0, 3)
    rows, at_corner = rng.integers(-1, 3, m), rng.random((m, 2)) < 0.4
    anchors, means = rng.uniform(-1.0, 1.0, (3, 2)), rng.uniform(-1.0, 1.0, (3, 2))
    ends, lines = rng.uniform(-2.0, 2.0, (m, 2, 2)), rng.uniform(0.01, 2.0, (m, 2))
    extents = np.where(rng.random((3, 1)) < 0.3, [[np.inf, -np.inf]], np.sort(rng.uniform(-1.0, 1.0, (3, 2)), axis=1))
    spacing = rng.uniform(0.0, 0.5, (3, 2))
    expected, apart_before = extents.copy(), spacing.copy()
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
            sharper = at_corner[k, side] and apart[k, side] < apart_before[row, side]
            if outwards > 0.0 or (sharper and -outwards < apart_before[row, side]):
                expected[row, side], apart_before[row, side] = along[k, side], apart[k, side]
    stretch(rows, along, apart, at_corner, extents, spacing)
    np.testing.assert_array_equal(extents, expected)
    np.testing.assert_array_equal(spacing, apart_before)


@few
@given(seed=seeds)
def test_walls_within_range_are_cut_back_once_scan_after_scan_goes_through_them(seed):
    rng = np.random.default_rng(seed)
    pose, bearings = rng.uniform(-2.0, 2.0, 3), np.linspace(-np.pi, np.pi, 60, endpoint=False)
    ranges = np.where(rng.random(60) < 0.2, np.inf, rng.uniform(0.3, 3.0, 60))
    passed = np.where(np.isfinite(ranges), ranges, 3.0 * (rng.random(60) < 0.5))
    means = np.column_stack([rng.uniform(-3.0, 3.0, 4), rng.uniform(-0.2, 0.2, 4)])
    normal = np.column_stack([np.cos(means[:, 0]), np.sin(means[:, 0])])
    anchors = pose[:2] + rng.uniform(-0.3, 2.5, (4, 1)) * normal + rng.normal(0.0, 0.2, (4, 2))
    extents, spacing = np.sort(rng.uniform(-1.0, 1.0, (4, 2)), axis=1), rng.uniform(0.0, 0.2, (4, 2))
    against, beams = rng.integers(0, 3, 4), np.zeros(4, dtype=int)
    was = extents, spacing, against
    ends, apart, scans = (one.copy() for one in was)
    for k, (low, high) in enumerate(extents):
        t = np.array([-normal[k, 1], normal[k, 0]])
        wall = shapely.LineString(anchors[k] + means[k, 1] * normal[k] + extents[k][:, None] * t)
        if wall.distance(shapely.Point(pose[:2])) >= 2.0:
            continue
        through, on, inside_m = [], [], min(0.2, (high - low) / 4.0)
        for bearing, range_m, passed_m in zip(bearings, ranges, passed, strict=True):
            along, across = crossing(bearing, passed_m, pose, anchors[k], *means[k])
            beams[k] += low < along < high and across >= -0.1
            if low + inside_m < along < high - inside_m:
                if across > 0.2:
                    through.append(along)
                elif across >= -0.2 and np.isfinite(range_m):
                    on.append(along)
        scans[k] = scans[k] + 1 if through else 0
        if scans[k] >= 2:
            ends[k], scans[k] = left_of(extents[k], through, np.array(on), 0.15), 0
            apart[k] = np.where(ends[k] == extents[k], apart[k], 0.2)
    found = contradict(bearings, ranges, passed, 2.0, pose, anchors, means, *was, 0.1, 0.2, 0.15, 2)
    np.testing.assert_array_equal(found, beams)
    np.testing.assert_allclose(extents, ends, atol=1e-12)
    np.testing.assert_array_equal(spacing, apart)
    np.testing.assert_array_equal(against, scans)
