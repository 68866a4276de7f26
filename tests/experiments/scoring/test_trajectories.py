"""Absolute and relative errors of a path, held against evo."""

import numpy as np
import pytest
from evo.core import metrics, sync, trajectory

from chainslam.experiments.scoring.trajectories import aligned, ate, position_errors, rpe
from chainslam.slam.geometry.poses import compose


def paths(seed, steps=40):
    rng = np.random.default_rng(seed)
    true, estimated = [rng.normal(size=3)], [rng.normal(size=3)]
    for _ in range(steps):
        motion = rng.normal(size=3) * [0.1, 0.02, 0.2]
        true.append(compose(true[-1], motion))
        estimated.append(compose(estimated[-1], motion + 0.02 * rng.normal(size=3)))
    return np.array(estimated), np.array(true)


def of_evo(poses):
    half = 0.5 * poses[:, 2]
    quaternions = np.column_stack([np.cos(half), 0 * half, 0 * half, np.sin(half)])
    places = np.column_stack([poses[:, :2], 0 * half])
    return trajectory.PoseTrajectory3D(places, quaternions, np.arange(len(poses)) * 0.1)


def rmse(metric, pair):
    metric.process_data(pair)
    return metric.get_statistic(metrics.StatisticsType.rmse)


@pytest.mark.parametrize("seed", range(3))
def test_errors_are_those_of_evo(seed):
    estimated, true = paths(seed)
    reference, other = sync.associate_trajectories(of_evo(true), of_evo(estimated))
    whole, turn = metrics.PoseRelation.translation_part, metrics.PoseRelation.rotation_angle_rad
    assert ate(estimated, true) == pytest.approx(rmse(metrics.APE(whole), (reference, other)), rel=1e-9)
    for every in (1, 10):
        shift, angle = rpe(estimated, true, every)
        options = {"delta": every, "delta_unit": metrics.Unit.frames, "all_pairs": True}
        assert shift == pytest.approx(rmse(metrics.RPE(whole, **options), (reference, other)), rel=1e-9)
        assert angle == pytest.approx(rmse(metrics.RPE(turn, **options), (reference, other)), rel=1e-6)
    other.align(reference)
    assert ate(estimated, true, align=True) == pytest.approx(rmse(metrics.APE(whole), (reference, other)), rel=1e-6)


def test_alignment_undoes_any_rigid_motion():
    estimated, true = paths(7)
    moved = np.array([compose(np.array([3.0, -1.0, 2.0]), pose) for pose in true])
    np.testing.assert_allclose(aligned(moved, true), true, atol=1e-9)
    assert position_errors(moved, true).min() > 0.1
    assert ate(estimated, true, align=True) <= ate(estimated, true)


def test_a_path_shorter_than_the_span_is_refused():
    estimated, true = paths(1, steps=3)
    with pytest.raises(ValueError, match="more than 4 poses"):
        rpe(estimated, true, 4)
