"""Errors of relations and of a path against a reference: an independent way by matrices, and evo's own numbers."""

import numpy as np
import pytest
from evo.core import metrics, sync
from evo.core.trajectory import PoseTrajectory3D

from chainslam.experiments.scoring.trajectories import ate
from chainslam.experiments.scoring.without_truth.relations import (
    Relations,
    errors_at_scans,
    errors_between_scans,
    interpolated,
    nearest_rows,
    paired_poses,
    relation_errors,
    same_scan_s,
)


def matrix(pose):
    c, s = np.cos(pose[2]), np.sin(pose[2])
    return np.array([[c, -s, pose[0]], [s, c, pose[1]], [0.0, 0.0, 1.0]])


def walk(count, seed):
    rng = np.random.default_rng(seed)
    return np.cumsum(rng.normal(0.0, 0.4, (count, 3)), axis=0)


def test_errors_are_those_of_the_matrices():
    first, second, measured = walk(30, 1), walk(30, 2), walk(30, 3)
    found = relation_errors(first, second, measured)
    for k in range(30):
        left = np.linalg.inv(matrix(measured[k])) @ np.linalg.inv(matrix(first[k])) @ matrix(second[k])
        np.testing.assert_allclose(found[k, 0], np.hypot(*left[:2, 2]), atol=1e-12)
        np.testing.assert_allclose(found[k, 1], abs(np.arctan2(left[1, 0], left[0, 0])), atol=1e-12)


def test_a_path_that_agrees_has_no_error_whatever_its_frame():
    path = walk(20, 4)
    moved = np.array([matrix([3.0, -1.0, 2.0]) @ matrix(pose) for pose in path])
    turned = np.column_stack([moved[:, 0, 2], moved[:, 1, 2], path[:, 2] + 2.0])
    relations = Relations(np.arange(10.0), np.arange(10.0, 20.0), np.zeros((10, 3)))
    exact = np.array([np.linalg.inv(matrix(path[k])) @ matrix(path[k + 10]) for k in range(10)])
    motions = np.column_stack([exact[:, 0, 2], exact[:, 1, 2], np.arctan2(exact[:, 1, 0], exact[:, 0, 0])])
    relations = Relations(relations.first_s, relations.second_s, motions)
    for score in (errors_at_scans, errors_between_scans):
        chosen, errors = score(np.arange(20.0), turned, relations)
        assert len(chosen.first_s) == 10
        np.testing.assert_allclose(errors, 0.0, atol=1e-9)


def test_only_times_of_scans_count_at_scans_and_all_that_the_path_covers_between():
    times = np.array([0.0, 1.0, 2.0, 100.0])
    relations = Relations(
        np.array([0.009, 0.0, 0.5, 1.0, -1.0]), np.array([1.0, 99.991, 2.0, 2.02, 1.0]), np.zeros((5, 3))
    )
    path = np.column_stack([times, np.zeros((4, 2))])
    at, errors = errors_at_scans(times, path, relations)
    np.testing.assert_allclose(at.second_s, [1.0, 99.991])
    np.testing.assert_allclose(errors[:, 0], [0.991, 99.991])
    np.testing.assert_array_equal(at.far, [False, True])
    between, errors = errors_between_scans(times, path, relations)
    np.testing.assert_allclose(errors[:, 0], between.second_s - between.first_s)
    assert len(errors) == 4


def test_a_minute_is_far_in_either_direction():
    relations = Relations(np.array([0.0, 60.0, 0.0]), np.array([60.0, 0.0, 59.9]), np.zeros((3, 3)))
    np.testing.assert_array_equal(relations.far, [True, True, False])


def test_between_two_poses_the_robot_goes_evenly_and_turns_the_short_way():
    found = interpolated(np.array([0.0, 2.0]), np.array([[0.0, 0.0, 3.0], [2.0, 4.0, -3.0]]), np.array([0.5, 1.0]))
    np.testing.assert_allclose(found[:, :2], [[0.5, 1.0], [1.0, 2.0]])
    np.testing.assert_allclose(np.abs(found[1, 2]), np.pi, atol=1e-12)


def test_the_nearest_time_is_found_at_the_ends_too():
    rows, near = nearest_rows(np.array([1.0, 2.0, 3.0]), np.array([0.0, 1.4, 1.6, 2.005, 9.0]))
    np.testing.assert_array_equal(rows, [0, 0, 1, 1, 2])
    np.testing.assert_array_equal(near, [False, False, False, True, False])


def as_evo(times, poses):
    half = 0.5 * poses[:, 2]
    zero = np.zeros(len(poses))
    return PoseTrajectory3D(
        np.column_stack([poses[:, :2], zero]), np.column_stack([np.cos(half), zero, zero, np.sin(half)]), times
    )


@pytest.mark.parametrize("counts", [(200, 60), (60, 200)])
def test_ate_is_that_of_evo_for_paths_of_other_times(counts):
    rng = np.random.default_rng(7)
    ours, theirs = (np.sort(rng.uniform(0, 10, count)) for count in counts)
    estimated, reference = walk(counts[0], 5), walk(counts[1], 6)
    first, second = sync.associate_trajectories(as_evo(ours, estimated), as_evo(theirs, reference), max_diff=0.01)
    mine = paired_poses(ours, estimated, theirs, reference)
    assert len(mine[0]) == first.num_poses > 3
    for align in (False, True):
        if align:
            first.align(second)
        ape = metrics.APE(metrics.PoseRelation.translation_part)
        ape.process_data((second, first))
        assert ate(*mine, align=align) == pytest.approx(ape.get_statistic(metrics.StatisticsType.rmse), rel=1e-9)


@pytest.mark.parametrize(
    ("times", "within_s"),
    [
        ([], 0.01),
        ([5.0], 0.01),
        ([0.0, 0.0, 0.0], 0.01),
        ([0.0, 0.2, 0.4], 0.01),
        ([0.0, 0.2, 0.201, 0.5], 0.0005),
        ([0.201, 0.0, 0.5, 0.2], 0.0005),
    ],
)
def test_times_of_one_scan_are_nearer_than_any_two_scans(times, within_s):
    assert same_scan_s(np.array(times)) == pytest.approx(within_s)


def test_a_scan_of_a_burst_that_the_log_left_out_has_no_pose():
    # Four scans are stamped within 3 ms, though the robot goes on by 0.1 m from each to the next.
    times = np.concatenate([np.arange(4) * 1e-3 + each for each in (0.0, 1.0, 2.0)])
    path = np.column_stack([0.1 * np.arange(12), np.zeros((12, 2))])
    first, second = np.triu_indices(12, 1)
    relations = Relations(times[first], times[second], path[second] - path[first])
    kept = np.delete(np.arange(12), [2, 5, 8])
    at, errors = errors_at_scans(times[kept], path[kept], relations)
    assert len(at.first_s) == 9 * 8 / 2
    np.testing.assert_allclose(errors, 0.0, atol=1e-12)
