"""What the map makes of a wall that bends or steps, as the robot drives along it."""

import numpy as np
import pytest
from scipy.stats import chi2

from chainslam.slam.backends import BACKENDS
from chainslam.slam.config import MapperConfig
from chainslam.slam.geometry.lines import normals, through
from chainslam.slam.geometry.poses import wrap
from tests.slam.map import scenes

WHEELS = [0.01, 0.01, np.deg2rad(1.0)]


def there_and_back(steps=100, away_m=1.0):
    """Return poses along a wall and back."""
    way = np.concatenate([np.linspace(-4, 4, steps // 2), np.linspace(4, -4, steps - steps // 2)])
    return np.column_stack([way, np.full(steps, -away_m), np.zeros(steps)])


def drive(faces, poses, backend="full-ekf", sigma_m=0.01, seed=0):
    """Return the update of each step."""
    seen = scenes.scans(faces, poses, np.random.default_rng(seed), sigma_m)
    return scenes.drive(poses, seen, backend, MapperConfig(), WHEELS)


def chi2_of_faces(walls, row, faces):
    """Return how far the lines of faces are from that of a wall, squared, in the covariance stated with it."""
    belief = walls.told.belief
    lines = through(np.asarray(faces))
    lines[:, 1] -= normals(lines[:, 0]) @ belief.anchors[row]
    off = lines - belief.means[row]
    off[:, 0] = wrap(off[:, 0])
    cov = belief.joint(belief.ids[row : row + 1]).cov[3:, 3:]
    return np.vecdot(off, np.linalg.solve(cov, off.T).T)


def chi2_of_poses(updates, poses):
    """Return how far the robot believes to be from where it is, squared, in the covariance of its pose."""
    off = np.array([update.map.belief.pose_world for update in updates]) - poses
    cov = np.array([update.map.belief.pose_cov for update in updates])
    return np.vecdot(off, np.linalg.solve(cov, off[..., None])[..., 0])


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_a_wall_whose_bend_a_scan_shows_becomes_two_and_stays_two(backend):
    turn = np.deg2rad(0.8)
    updates = drive(scenes.bent(turn), there_and_back(), backend, sigma_m=0.0)
    walls = updates[-1].map
    assert len(walls) == 2
    assert not walls.crooked.any()
    first = next(k for k, update in enumerate(updates) if len(update.map) == 2)
    assert all(len(update.map) == 2 for update in updates[first:])
    alpha = walls.belief.means[:, 0]
    assert abs(alpha[0] - alpha[1]) == pytest.approx(turn, abs=np.deg2rad(0.1))
    assert max(update.map.belief.pose_world[2] for update in updates[first + 15 :]) < np.deg2rad(0.45)


EVERYWHERE = [("full-ekf", away_m, seed) for away_m in (2.5, 3.0) for seed in range(3)]


@pytest.mark.parametrize(
    ("backend", "away_m", "seed"), EVERYWHERE + [(one, 3.0, 1) for one in BACKENDS if one != "full-ekf"]
)
def test_a_line_over_a_bend_that_only_many_scans_show_is_stated_as_far_off_as_the_faces_are(backend, away_m, seed):
    """From so far one line fits both faces in every scan; stated as a line it was off one of them by five sigmas."""
    faces = scenes.bent(np.deg2rad(0.5))
    walls = drive(faces, there_and_back(away_m=away_m), backend, seed=seed)[-1].map
    assert walls.crooked.tolist() == [True]
    assert chi2_of_faces(walls, 0, faces).max() < chi2.ppf(0.95, 2)


@pytest.mark.parametrize("seed", range(3))
def test_once_a_bend_is_known_no_pose_is_off_by_more_than_is_stated(seed):
    poses = there_and_back(away_m=2.5)
    updates = drive(scenes.bent(np.deg2rad(0.5)), poses, seed=seed)
    known = next(k for k, update in enumerate(updates) if update.map.crooked.any())
    assert known < 40
    assert chi2_of_poses(updates, poses)[known + 15 :].max() < chi2.ppf(0.999, 3)


def to_and_fro(steps=120):
    """Return poses in a room 6 m wide, 1.3 to 2.7 m before its wall along y = 0."""
    k = 2.0 * np.pi * np.arange(steps)
    return np.column_stack([2.2 * np.sin(k / 60), -2.0 + 0.7 * np.cos(k / 47), 0.3 * np.sin(k / 37)])


@pytest.mark.parametrize("step_m", [0.01, 0.02])
@pytest.mark.parametrize("seed", range(2))
def test_a_line_over_a_step_is_stated_as_far_off_as_the_faces_are_and_poses_stay_consistent(step_m, seed):
    """As thick as a poster, or a door's leaf: the other walls of the room are straight."""
    stepping = scenes.stepped(step_m, 2.999)
    faces, poses = np.concatenate([scenes.AROUND, stepping]), to_and_fro()
    updates = drive(faces, poses, seed=seed)
    walls = updates[-1].map
    (over,) = np.flatnonzero(walls.crooked)
    assert np.ptp(walls.ends_world[over, :, 0]) > 5.9
    assert chi2_of_faces(walls, over, stepping[[1, 3]]).max() < chi2.ppf(0.95, 2)
    assert np.mean(chi2_of_poses(updates, poses)) / 3 < 1.0


@pytest.mark.parametrize("away_m", [1.0, 2.5, 3.0])
@pytest.mark.parametrize("seed", range(3))
def test_a_straight_wall_stays_one_and_is_never_stated_crooked(away_m, seed):
    for update in drive(scenes.bent(0.0), there_and_back(away_m=away_m), seed=seed):
        assert update.map.crooked.tolist() == [False]
        assert np.abs(update.map.off_line_cov).max() < 1e-12
