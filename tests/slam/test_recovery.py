"""A robot that was moved and does not know: the mapper says so, finds its place, or says that it has none."""

from dataclasses import replace

import numpy as np
import pytest

from chainslam.sim.lidar import LidarConfig, RangeFinder, noisy
from chainslam.slam.association.leap import Leap
from chainslam.slam.association.place_search import PlaceSearchConfig
from chainslam.slam.association.recovery import RecoveryConfig
from chainslam.slam.backends import BACKENDS
from chainslam.slam.config import MapperConfig
from chainslam.slam.estimation.backend import ContradictionError
from chainslam.slam.geometry.poses import compose, wrap
from chainslam.slam.mapper import Mapper
from chainslam.slam.robot import Odometry, Scan
from tests.slam.extraction.test_extract import HALL, loop
from tests.slam.test_mapper import ODOMETRY_COV, P0

CONFIG = LidarConfig(beams=360, range_max_m=6.0)
ELSEWHERE = loop((40, 0), (43, 0), (44, 1.5), (43.4, 3.1), (40.5, 3.5), (39, 1.5))
WORLD = np.concatenate([HALL, ELSEWHERE])
START = np.array([2.1, 2.0, 0.3])
STEP = np.array([0.05, 0.0, 0.02])
STEPS = 12


class Drive:
    """A mapper that is driven through the hall, with noise in the scans; the odometry tells what it is told to tell."""

    def __init__(self, backend="full-ekf", config=MapperConfig(), seed=0, steps=STEPS):
        self.rng, self.finder = np.random.default_rng(seed), RangeFinder(WORLD, CONFIG)
        self.mapper = Mapper(BACKENDS[backend].make(START.copy(), P0.copy()), config)
        self.pose = START.copy()
        self.updates = [self.see()]
        for _ in range(steps):
            self.move(STEP)

    def see(self):
        noise = self.rng.standard_normal(360)
        ranges = noisy(self.finder.cast(self.pose)[0], np.full(360, 0.01), noise, CONFIG.range_max_m)
        return self.mapper.step(Scan(self.finder.bearings_rad, ranges, 0.01, CONFIG.range_max_m, 0.0))

    def move(self, motion, unreported=(0.0, 0.0, 0.0), cov=ODOMETRY_COV, by_scans=False):
        self.mapper.predict(Odometry(motion, cov, by_scans=by_scans))
        self.pose = compose(compose(self.pose, motion), np.asarray(unreported))
        self.updates.append(self.see())
        return self.updates[-1]

    @property
    def off(self):
        """How far off the estimate is, m and degrees."""
        error = self.mapper.backend.belief.pose_world - self.pose
        return np.hypot(*error[:2]), np.rad2deg(abs(wrap(error[2])))


@pytest.mark.parametrize(("backend", "turn_deg"), [*((name, -8.0) for name in BACKENDS), ("full-ekf", 20.0)])
def test_a_turn_that_nobody_reported_is_found_at_the_next_scan(backend, turn_deg):
    drive = Drive(backend)
    walls = len(drive.updates[-1].map)
    update = drive.move(STEP, [0.0, 0.0, np.deg2rad(turn_deg)])
    assert np.rad2deg(update.localisation.unstated_motion.motion[2]) == pytest.approx(turn_deg, abs=1.0)
    assert len(update.map) == walls
    assert drive.off[0] < 0.05
    assert drive.off[1] < 0.5
    later = [drive.move(STEP).localisation for _ in range(5)]
    assert all(one.unstated_motion is None and not one.is_lost for one in later)


@pytest.mark.parametrize("recovery", [RecoveryConfig(), None])
def test_a_scan_with_which_no_estimate_agrees_is_left_out_and_the_next_is_taken_in(recovery, monkeypatch):
    drive = Drive("graph", MapperConfig(recovery=recovery))
    before = drive.updates[-1]

    def contradicts(*_):
        raise ContradictionError

    with monkeypatch.context() as patch:
        patch.setattr(drive.mapper.backend, "update", contradicts)
        left_out = drive.move(STEP)
    assert left_out.localisation.is_lost
    assert (left_out.walls_of_segments == -1).all()
    np.testing.assert_array_equal(left_out.map.ids, before.map.ids)
    np.testing.assert_array_equal(left_out.map.observations, before.map.observations)
    after = drive.move(STEP)
    assert not after.localisation.is_lost
    assert (after.walls_of_segments >= 0).any()
    assert drive.off[0] < 0.05


def test_the_third_scan_in_turn_with_which_no_estimate_agrees_is_one_too_many(monkeypatch):
    drive = Drive("graph")

    def contradicts(*_):
        raise ContradictionError

    for _ in range(2):
        with monkeypatch.context() as patch:
            patch.setattr(drive.mapper.backend, "update", contradicts)
            drive.move(STEP)
            drive.move(STEP)
        assert not drive.move(STEP).localisation.is_lost
    monkeypatch.setattr(drive.mapper.backend, "update", contradicts)
    drive.move(STEP)
    drive.move(STEP)
    with pytest.raises(ContradictionError):
        drive.move(STEP)


def test_a_robot_taken_at_its_word_keeps_the_turn():
    drive = Drive(config=MapperConfig(recovery=None))
    update = drive.move(STEP, [0.0, 0.0, np.deg2rad(20.0)])
    assert update.localisation.unstated_motion is None
    assert drive.off[1] > 10.0


@pytest.mark.parametrize("seed", range(6))
def test_a_robot_that_tells_the_truth_is_never_doubted(seed):
    drive, rng = Drive(seed=seed), np.random.default_rng(100 + seed)
    for _ in range(50):
        drive.move(STEP, rng.multivariate_normal(np.zeros(3), ODOMETRY_COV))
    told = [update.localisation for update in drive.updates]
    assert all(one.unstated_motion is None and not one.is_lost and one.noise_factor == 1.0 for one in told)
    dof = sum(one.nis.dof for one in told)
    assert 0.8 < sum(one.nis.squared for one in told) / dof < 1.2


def carried_across_the_hall():
    """A drive, and its updates since the robot was carried: one there, and others on the way from there."""
    drive = Drive()
    told = [drive.move(np.zeros(3), _relative(drive.pose, np.array([0.8, 2.8, -0.7])))]
    return drive, told


def test_a_robot_carried_across_the_hall_is_found_by_a_search_of_the_map_once_two_places_say_the_same():
    drive, told = carried_across_the_hall()
    while told[-1].localisation.is_lost and len(told) < 30:
        assert told[-1].localisation.is_leap_pending
        told.append(drive.move(STEP))
    least = PlaceSearchConfig.apart_m / np.hypot(*STEP[:2])
    assert least <= len(told) - 1 <= least + 1
    assert told[-1].localisation.unstated_motion is not None
    np.testing.assert_array_equal(told[-1].localisation.unstated_motion.cov, RecoveryConfig().place.cov)
    assert drive.off[0] < 0.1
    assert not drive.move(STEP).localisation.is_lost


def test_a_robot_that_stands_or_turns_where_it_was_carried_earns_no_leap():
    drive, told = carried_across_the_hall()
    told += [drive.move(np.array([0.0, 0.0, 0.1])) for _ in range(12)]
    assert all(update.localisation.is_lost and update.localisation.is_leap_pending for update in told)


def test_where_scans_tell_that_nobody_carried_the_robot_it_does_not_leap():
    drive = Drive()
    told = [drive.move(np.zeros(3), _relative(drive.pose, np.array([0.8, 2.8, -0.7])), by_scans=True)]
    told += [drive.move(STEP, by_scans=True) for _ in range(14)]
    far = [update.localisation.unstated_motion for update in told if update.localisation.unstated_motion is not None]
    assert all(np.hypot(*motion.motion[:2]) < 1.0 for motion in far)


def test_a_leap_begins_anew_where_a_scan_shows_another_place():
    config = PlaceSearchConfig()
    leap, ahead = Leap(config), Odometry(np.array([0.3, 0.0, 0.0]), 1e-6 * np.eye(3))
    here, there = np.array([5.0, 1.0, 0.0]), np.array([9.0, 4.0, 1.0])
    assert not leap.is_earned(here, True)
    leap.move(ahead)
    assert not leap.is_earned(here + ahead.motion, True)
    leap.move(ahead)
    assert not leap.is_earned(there, True)
    leap.move(ahead)
    assert not leap.is_earned(compose(there, ahead.motion), True)
    leap.move(ahead)
    assert leap.is_earned(compose(there, 2.0 * ahead.motion), True)
    leap.drop()
    assert not leap.is_earned(here, False)
    assert not leap.is_pending


def test_a_robot_carried_to_another_building_is_lost_and_keeps_its_map():
    drive = Drive()
    before = drive.updates[-1]
    there = np.array([41.5, 1.5, 0.3])
    home, motion = drive.pose.copy(), _relative(drive.pose, there)
    update = drive.move(np.zeros(3), motion)
    assert update.localisation.is_lost
    assert update.map.ids.tolist() == before.map.ids.tolist()
    assert (update.walls_of_segments == -1).all()
    assert drive.move(STEP).localisation.is_lost
    back = drive.move(np.zeros(3), _relative(drive.pose, home))
    assert not back.localisation.is_lost
    assert drive.off[0] < 0.1


def test_a_scan_is_laid_beside_the_walls_near_it_and_where_the_robot_may_have_moved_beside_those_near_it_then():
    drive = Drive()
    mapper, walls, asked = drive.mapper, drive.updates[-1].map, []
    scan = Scan(drive.finder.bearings_rad, drive.finder.cast(drive.pose)[0], 0.01, CONFIG.range_max_m, 0.0)
    one = drive.updates[-1].segments.take(np.array([0]))
    near, moved = (mapper._view(scan, one, walls, may_have_moved=so).walls.ids for so in (False, True))
    in_range = walls.ids[walls.distances_m < CONFIG.range_max_m]
    assert 0 < len(near) < len(moved)
    assert set(near) < set(moved) == set(in_range)
    mapper.config = replace(mapper.config, recovery=RecoveryConfig(shift_m=0.1, turn_rad=0.03))
    little = mapper._view(scan, one, walls, may_have_moved=True).walls.ids
    assert set(near) <= set(little) < set(in_range)
    mapper.config = replace(mapper.config, recovery=RecoveryConfig())
    view = mapper._view
    mapper._view = lambda *of, may_have_moved=False: (
        asked.append(may_have_moved) or view(*of, may_have_moved=may_have_moved)
    )
    drive.move(STEP)
    assert set(asked) == {False}
    drive.move(STEP, [0.0, 0.0, np.deg2rad(-8.0)])
    assert any(asked)


def test_where_scans_told_the_motion_the_walls_are_doubted_and_not_the_robot():
    """Walls that were once drawn at a wrong pose contradict each scan from then on; a map that stops keeps them."""
    drive = Drive()
    before = len(drive.updates[-1].map)
    motion = _relative(drive.pose, np.array([41.5, 1.5, 0.3]))
    update = drive.move(np.zeros(3), motion, by_scans=True)
    assert not update.localisation.is_lost
    assert len(update.map) > before
    assert not drive.move(STEP, by_scans=True).localisation.is_lost


def test_wheels_that_slip_more_than_they_state_are_found_out():
    drive, rng = Drive(), np.random.default_rng(5)
    cov = np.diag([0.003, 0.003, 0.004]) ** 2
    told = []
    for _ in range(40):
        slip = 4.0 * rng.standard_normal(3) * np.sqrt(np.diagonal(cov))
        told.append(drive.move(-STEP if len(told) % 2 else STEP, slip, cov).localisation.noise_factor)
    assert told[0] == 1.0
    assert told[-1] >= 2.0


def _relative(from_world, to_world):
    return np.array([*_turned(to_world[:2] - from_world[:2], -from_world[2]), wrap(to_world[2] - from_world[2])])


def _turned(vector, angle):
    c, s = np.cos(angle), np.sin(angle)
    return np.array([[c, -s], [s, c]]) @ vector
