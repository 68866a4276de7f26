"""What the map makes of a wall that bends, as the robot drives along it."""

import numpy as np
import pytest

from chainslam.slam.backends import BACKENDS
from chainslam.slam.config import MapperConfig
from chainslam.slam.map.polylines.change_points import ChangePointsConfig
from tests.slam.map.polylines import scenes


def drive(change_points, turn_rad, backend="full-ekf", steps=100, sigma=0.0, seed=0, away_m=1.0):
    """Drive along a bent wall and back; return the update of each step."""
    way = np.concatenate([np.linspace(-4, 4, steps // 2), np.linspace(4, -4, steps - steps // 2)])
    poses = np.column_stack([way, np.full(steps, -away_m), np.zeros(steps)])
    seen = scenes.scans(scenes.bent(turn_rad), poses, np.random.default_rng(seed), sigma)
    config = MapperConfig(change_points=change_points)
    return scenes.drive(poses, seen, backend, config, [0.01, 0.01, np.deg2rad(1.0)])


@pytest.mark.parametrize("backend", list(BACKENDS))
def test_a_wall_that_bends_becomes_two_and_stays_two(backend):
    turn = np.deg2rad(0.8)
    updates = drive(ChangePointsConfig(), turn, backend)
    walls = updates[-1].map
    assert len(walls) == 2
    first = next(k for k, update in enumerate(updates) if len(update.map) == 2)
    assert all(len(update.map) == 2 for update in updates[first:])
    alpha = walls.belief.means[:, 0]
    assert abs(alpha[0] - alpha[1]) == pytest.approx(turn, abs=np.deg2rad(0.1))
    assert max(update.map.belief.pose_world[2] for update in updates[first + 15 :]) < np.deg2rad(0.45)


@pytest.mark.parametrize("seed", range(3))
def test_the_sides_of_a_bend_never_overlap(seed):
    """Each fits, within the noise, a piece of the other."""
    updates = drive(ChangePointsConfig(), np.deg2rad(0.6), steps=300, sigma=0.01, seed=seed)
    last = updates[-1].map
    one, other = np.sort(last.ends_world[..., 0], axis=-1)[np.argsort(last.ends_world[..., 0].min(axis=-1))]
    assert -0.5 < one[1] < 0.5
    assert abs(other[0] - one[1]) < 0.06


@pytest.mark.parametrize("away_m", [2.5, 3.0])
def test_a_bend_that_only_many_scans_together_show_makes_two_walls_of_one(away_m):
    """From so far one line fits both sides in every scan; without the sums over the scans they stay one wall."""
    turn, found = np.deg2rad(0.5), []
    for seed in range(3):
        updates = drive(ChangePointsConfig(), turn, steps=120, sigma=0.01, seed=seed, away_m=away_m)
        assert len(updates[15].map) == 1
        found.append(len(updates[-1].map) == 2)
        if found[-1]:
            alpha = updates[-1].map.belief.means[:, 0]
            assert abs(alpha[0] - alpha[1]) == pytest.approx(turn, abs=np.deg2rad(0.25))
    assert sum(found) >= 2


def test_the_sides_of_a_bend_that_many_scans_show_begin_as_sure_as_can_be():
    """A wall seen once is tentative otherwise."""
    updates = drive(ChangePointsConfig(), np.deg2rad(0.5), steps=80, sigma=0.01, away_m=3.0)
    two = next(update.map for update in updates if len(update.map) == 2)
    assert two.observations.tolist() == [1, 1]
    assert not two.tentative.any()


def test_a_straight_wall_stays_one_and_no_number_is_changed():
    off, on = (
        drive(change_points, 0.0)[-1].map for change_points in (ChangePointsConfig(sigmas=np.inf), ChangePointsConfig())
    )
    assert len(on) == 1
    np.testing.assert_array_equal(on.belief.means, off.belief.means)
    np.testing.assert_array_equal(on.extents, off.extents)
