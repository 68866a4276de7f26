"""The error of a pose in space is what its definition says, by matrix logarithms, and its covariance goes with it."""

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from scipy.linalg import expm, logm
from scipy.spatial.transform import Rotation, Slerp

from chainslam.experiments.library.audit.geometry import space
from chainslam.experiments.usage import UsageError
from chainslam.slam.evaluation.consistency import nees

from .spaces import FRAMES, hat, matrix, pose, pose_of, vee

PLACES = st.lists(st.floats(-20.0, 20.0), min_size=3, max_size=3)
# No longer than 2.95 rad, and none so small that SciPy's logarithm of a matrix divides by 1e-300.
TURNS = st.lists(st.integers(-1_700_000, 1_700_000).map(lambda k: 1e-6 * k), min_size=3, max_size=3)


def random_poses(rng, count):
    return np.column_stack([rng.uniform(-3.0, 3.0, (count, 3)), Rotation.random(count, rng=rng).as_quat()])


def random_covs(rng, count):
    roots = rng.standard_normal((count, 6, 6))
    return roots @ roots.swapaxes(1, 2) + np.eye(6)


def disturbed(x, xi, frame):
    if frame == "additive":
        return np.append(x[:3] + xi[:3], (Rotation.from_rotvec(xi[3:]) * Rotation.from_quat(x[3:])).as_quat())
    return pose_of(matrix(x) @ expm(hat(xi)) if frame == "body" else expm(hat(xi)) @ matrix(x))


@given(PLACES, TURNS, PLACES, TURNS)
def test_errors_are_the_logarithms_that_they_are_called(place, turn, shift, off):
    estimated, off = pose(place, turn), pose(shift, off)
    X, D = matrix(estimated), matrix(off)
    for frame, true in (("body", X @ D), ("world", D @ X)):
        [found] = space.errors(estimated[None], pose_of(true)[None], frame)
        assert found == pytest.approx(vee(logm(D)), abs=1e-7)
        assert expm(hat(found)) == pytest.approx(D, abs=1e-7)
    [plain] = space.errors(estimated[None], pose_of(D @ X)[None], "additive")
    assert plain[:3] == pytest.approx((D @ X)[:3, 3] - X[:3, 3], abs=1e-9)
    assert plain[3:] == pytest.approx(Rotation.from_quat(off[3:]).as_rotvec(), abs=1e-7)


@pytest.mark.parametrize("angle", [0.0, 1e-12, 1e-7, 0.999e-3, 1.001e-3, 0.1, 3.1])
def test_logarithms_of_small_and_of_large_turns(angle):
    xi = np.array([1.0, -2.0, 0.5, *(angle * np.array([0.6, 0.0, 0.8]))])
    assert space.logarithm(pose_of(expm(hat(xi)))[None])[0] == pytest.approx(xi, abs=1e-9)


@pytest.mark.parametrize("given_in", FRAMES)
@pytest.mark.parametrize("wanted", FRAMES)
def test_covariances_of_one_frame_become_those_of_another_as_finite_differences_do(given_in, wanted):
    rng, h = np.random.default_rng(1), 1e-6
    poses, covs = random_poses(rng, 5), random_covs(rng, 5)
    for x, cov, told in zip(poses, covs, space.to_frame(poses, covs, given_in, wanted), strict=True):
        columns = [
            (space.errors(x[None], disturbed(x, step, given_in)[None], wanted)
             - space.errors(x[None], disturbed(x, -step, given_in)[None], wanted))[0] / (2 * h)
            for step in h * np.eye(6)
        ]  # fmt: skip
        change = np.stack(columns, axis=1)
        assert told == pytest.approx(change @ cov @ change.T, rel=1e-6, abs=1e-6)


def test_covariances_of_relations_are_those_of_finite_differences():
    rng, h = np.random.default_rng(2), 1e-6
    first, second = random_poses(rng, 4), random_poses(rng, 4)
    roots = rng.standard_normal((4, 12, 12))
    covs = roots @ roots.swapaxes(1, 2)
    motions = space.between(first, second)
    for one, other, motion, cov, told in zip(
        first, second, motions, covs, space.relation_covs(motions, covs), strict=True
    ):
        columns = []
        for step in h * np.eye(12):
            ends = [
                space.between(disturbed(one, s * step[:6], "body")[None], disturbed(other, s * step[6:], "body")[None])
                for s in (1, -1)
            ]
            columns.append(np.subtract(*(space.errors(motion[None], end, "body")[0] for end in ends)))
        change = np.stack(columns, axis=1) / (2 * h)
        assert told == pytest.approx(change @ cov @ change.T, rel=1e-5, abs=1e-5)


@pytest.mark.parametrize("frame", FRAMES)
def test_the_nees_does_not_depend_on_the_frame_of_the_world(frame):
    rng = np.random.default_rng(3)
    true, covs, motion = random_poses(rng, 20), random_covs(rng, 20), random_poses(rng, 1)[0]
    estimated = np.array([disturbed(x, 0.1 * rng.standard_normal(6), "body") for x in true])
    before = nees(space.errors(estimated, true, frame), covs)
    turned = space.moved(estimated, motion), space.moved(true, motion)
    assert nees(space.errors(*turned, frame), space.moved_covs(covs, motion, frame)) == pytest.approx(before, rel=1e-9)


def test_paths_are_brought_onto_each_other_as_evo_does():
    from evo.core.trajectory import PosePath3D

    rng = np.random.default_rng(4)
    true, motion = random_poses(rng, 20), random_poses(rng, 1)[0]
    estimated = space.moved(true, motion)
    for found in (space.motion_at_start(estimated, true), space.alignment_of_paths(estimated, true)):
        assert np.array([matrix(x) for x in space.moved(estimated, found)]) == pytest.approx(
            np.array([matrix(x) for x in true]), abs=1e-9
        )
    estimated = np.array([disturbed(x, 0.2 * rng.standard_normal(6), "body") for x in estimated])
    theirs = PosePath3D(poses_se3=[matrix(x) for x in estimated])
    theirs.align(PosePath3D(poses_se3=[matrix(x) for x in true]))
    ours = space.moved(estimated, space.alignment_of_paths(estimated, true))
    assert np.array([matrix(x) for x in ours]) == pytest.approx(np.array(theirs.poses_se3), abs=1e-9)


def test_a_straight_path_cannot_be_turned_about_itself():
    path = np.tile([0.0, 0.0, 0.0, 0.0, 0.0, 0.0, 1.0], (20, 1))
    path[:, 0] = np.arange(20.0)
    with pytest.raises(UsageError, match="no straight line"):
        space.alignment_of_paths(path, path)


def test_poses_between_others_are_those_of_scipy():
    rng = np.random.default_rng(5)
    times, poses, asked = np.arange(6.0), random_poses(rng, 6), rng.uniform(0.0, 5.0, 30)
    found = space.interpolated(times, poses, asked)
    turns = Slerp(times, Rotation.from_quat(poses[:, 3:]))(asked)
    assert (Rotation.from_quat(found[:, 3:]).inv() * turns).magnitude() == pytest.approx(np.zeros(30), abs=1e-9)
    assert found[:, :3] == pytest.approx(np.column_stack([np.interp(asked, times, axis) for axis in poses[:, :3].T]))
    assert space.interpolated(times[:1], poses[:1], asked[:2])[:, :3] == pytest.approx(np.tile(poses[0, :3], (2, 1)))
