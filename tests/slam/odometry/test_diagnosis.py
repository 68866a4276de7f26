"""What is wrong with a robot is told from its last scans; a sound robot, or one that is pushed, is never accused."""

import re
from dataclasses import replace

import numpy as np
import pytest
import shapely

from chainslam.experiments.scenario import load_world
from chainslam.sim.faults import FaultsConfig
from chainslam.sim.lidar import LidarConfig
from chainslam.sim.robot import RobotConfig, SimulatedRobot
from chainslam.sim.worlds import World
from chainslam.slam.estimation.mounting import odometry_of_scanner
from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.odometry.diagnosis import Diagnosis, DiagnosisConfig
from chainslam.slam.odometry.robot_faults import Fault, expected, tried_first
from chainslam.slam.odometry.scan_matching import told_by_scans
from chainslam.slam.robot import MotionCommand, Odometry, ScannerSpec

ROOMS = load_world("rooms")
NO_BUDGET = DiagnosisConfig(rescues=10**6)
MOUNTS = [ScannerSpec(), ScannerSpec(0.12, 0.0, 0.0), ScannerSpec(-0.1, 0.05, 0.5 * np.pi)]


def drive(faults, seed, steps=40, config=NO_BUDGET, every=1, world=ROOMS, **robot):
    """Drive by chance, and ask after every so many scans what is wrong; return all answers."""
    spec = RobotConfig(faults=faults, **robot)
    robot, diagnosis = SimulatedRobot(world, seed, config=spec), Diagnosis(replace(config, robot=spec.spec))
    rng, said = np.random.default_rng(seed), []
    turn, turning = 0.0, 0
    for k in range(steps):
        said.append(diagnosis.see(robot.sense(), was_rescued=k % every == 0, is_in_doubt=False))
        if rng.random() < 0.3:
            turn = float(rng.choice([-1.0, 0.0, 0.0, 1.0])) * np.deg2rad(10.0)
        turning -= 1
        odometry = robot.drive(MotionCommand(0.0, 0.17) if turning > 0 else MotionCommand(0.15, turn))
        turning = 9 if odometry.touched else turning
        diagnosis.moved(odometry)
    return said


def of_kind(rng, kind):
    """A fault of a kind, as large as chance has it, and the words that it is to be told by."""
    if kind == "turned":
        degrees = float(rng.uniform(15.0, 180.0) * rng.choice([-1.0, 1.0]))
        return FaultsConfig(scanner_turned_rad=float(np.deg2rad(degrees))), "scanner is turned by about"
    if kind == "shifted":
        angle, far = rng.uniform(0.0, 2.0 * np.pi), rng.uniform(0.12, 0.45)
        return FaultsConfig(
            scanner_ahead_m=float(far * np.cos(angle)), scanner_left_m=float(far * np.sin(angle))
        ), "scanner sits about"
    if kind == "late":
        late = int(rng.integers(1, 4))
        return FaultsConfig(late=late), f"late by {late} step"
    if kind == "repeats":
        return FaultsConfig(frozen_from=int(rng.integers(1, 20))), "repeats one scan"
    if kind == "stands":
        return FaultsConfig(stuck_from=int(rng.integers(0, 20))), "the wheels turn while the robot stands"
    return FaultsConfig(mirrored=True), "left and right are swapped"


KINDS = ("mirrored", "turned", "shifted", "late", "repeats", "stands")


def named(kind, seed, mount):
    faults, words = of_kind(np.random.default_rng((seed, KINDS.index(kind))), kind)
    said = drive(faults, seed, 50, every=7, scanner=mount)
    first = next((each for each in said if each), "")
    assert words in first, (faults, first)


@pytest.mark.parametrize("kind", KINDS)
def test_every_fault_is_told_by_its_name(kind):
    named(kind, 0, MOUNTS[KINDS.index(kind) % 2])


@pytest.mark.long
@pytest.mark.parametrize("mount", MOUNTS[:2])
@pytest.mark.parametrize("kind", KINDS)
def test_faults_of_any_size_are_told_by_their_names(kind, mount):
    for seed in range(1, 6):
        named(kind, seed, mount)


@pytest.mark.parametrize("seed", range(1))
def test_how_far_a_scanner_is_turned_or_moved_is_told(seed):
    rng = np.random.default_rng(seed)
    degrees, ahead, left = rng.uniform(30.0, 150.0), rng.uniform(0.1, 0.4), rng.uniform(-0.4, -0.1)
    said = drive(FaultsConfig(scanner_turned_rad=float(np.deg2rad(degrees))), seed, 50, every=7)
    assert float(re.findall(r"about (-?\d+) degrees", said[49])[0]) == pytest.approx(degrees, abs=6.0)
    said = drive(FaultsConfig(scanner_ahead_m=ahead, scanner_left_m=left), seed, 50, every=7)
    found = re.findall(r"([\d.]+) m farther (ahead|to the right)", said[49])
    assert [way for _, way in found] == ["ahead", "to the right"]
    assert [float(metres) for metres, _ in found] == pytest.approx([ahead, -left], abs=0.06)


@pytest.mark.parametrize("seed", range(3))
def test_a_scanner_that_sits_aside_shows_over_some_turns_what_it_does_not_in_one(seed):
    """8 cm move it by 14 mm in a turn on the spot by 10 degrees, as much as two scans of 180 beams can be off."""
    for ahead_m, words in ((0.08, "sits about 0.0"), (0.0, "")):
        spec = RobotConfig(lidar=LidarConfig(beams=180), faults=FaultsConfig(scanner_ahead_m=ahead_m))
        robot, diagnosis = SimulatedRobot(ROOMS, seed, config=spec), Diagnosis(replace(NO_BUDGET, robot=spec.spec))
        said = []
        for k in range(33):
            said.append(diagnosis.see(robot.sense(), was_rescued=k % 4 == 0, is_in_doubt=False))
            diagnosis.moved(robot.drive(MotionCommand(0.0, 0.175)))
        assert any(said) if words else not any(said)
        assert words in max(said)


@pytest.mark.parametrize("seed", range(3))
def test_motions_that_the_wheels_did_not_tell_are_in_no_sum_of_motions(seed):
    """A triangle of whose sides the wheels tell nothing: with them, each turn would show a scanner that sits aside."""
    robot, diagnosis = SimulatedRobot(ROOMS, seed), Diagnosis(NO_BUDGET)
    for k in range(60):
        assert not diagnosis.see(robot.sense(), was_rescued=True, is_in_doubt=False)
        turns = k % 5 != 2
        odometry = robot.drive(MotionCommand(0.0, np.pi / 6.0) if turns else MotionCommand(0.15, 0.0))
        diagnosis.moved(odometry if turns else replace(odometry, wheels=odometry))


SOUND = {
    "sound": FaultsConfig(),
    "pushed": FaultsConfig(bump=0.15),
    "pushed far": FaultsConfig(bump=0.05, bump_rad=float(np.deg2rad(60.0))),
    "slips": FaultsConfig(slip=4.0),
    "in motion": FaultsConfig(moving=1.0),
    "loses returns": FaultsConfig(dropout=0.1, clump=8, mixed=0.5),
}


@pytest.mark.parametrize("kind", SOUND)
def test_nobody_else_is_accused(kind):
    which = list(SOUND).index(kind)
    assert not any(drive(SOUND[kind], which, 40, every=5, scanner=MOUNTS[which % 3]))


@pytest.mark.long
@pytest.mark.parametrize("mount", MOUNTS)
@pytest.mark.parametrize("kind", SOUND)
def test_nobody_else_is_accused_however_often_it_is_asked(kind, mount):
    for seed in range(3):
        assert not any(drive(SOUND[kind], 10 + seed, 80, scanner=mount))


@pytest.mark.parametrize("errorless", [False, True])
@pytest.mark.parametrize("resolution_m", [0.0, 0.02])
@pytest.mark.parametrize("width_m", [0.9, 1.4, 1.9, 2.6])
def test_a_corridor_that_looks_alike_everywhere_is_no_robot_that_stands(width_m, resolution_m, errorless):
    """Nor one whose scans are late or repeat, or whose scanner is turned: the scans do not tell how far it drove."""
    corridor = World("corridor", _box(60.0, width_m), np.array([30.0, 0.5 * width_m, 0.0]), {})
    config = RobotConfig(faults=FaultsConfig(resolution_m=resolution_m))
    for turn_rad in (0.02, 0.0):
        robot = SimulatedRobot(corridor, 1, errorless=errorless, config=config)
        diagnosis, said = Diagnosis(NO_BUDGET), []
        for k in range(50):
            scan = robot.sense()
            assert not diagnosis.repeats(scan)
            said.append(diagnosis.see(scan, k % 7 == 0, False))
            diagnosis.moved(robot.drive(MotionCommand(0.15, turn_rad if k % 2 else -turn_rad)))
        assert not any(said)


def test_a_fault_that_begins_on_the_way_is_told_within_a_few_scans_of_those_that_show_it():
    said = drive(FaultsConfig(stuck_from=20), 1, 32)
    first = next(k for k, each in enumerate(said) if each)
    assert 20 + NO_BUDGET.agree <= first <= 20 + NO_BUDGET.agree + 3


def test_wheels_that_spin_for_a_few_steps_are_no_fault():
    """Fewer than must agree: the scans after them speak for what is stated."""

    class Slick(SimulatedRobot):
        def drive(self, command):
            before = self._pose.copy()
            odometry = super().drive(command)
            if 20 <= self._drives < 20 + NO_BUDGET.agree - 1:
                self._pose = before
            return odometry

    spec = RobotConfig()
    robot, diagnosis, said = Slick(ROOMS, 1, config=spec), Diagnosis(NO_BUDGET), []
    for k in range(40):
        said.append(diagnosis.see(robot.sense(), True, False))
        diagnosis.moved(robot.drive(MotionCommand(0.1 * (k % 20 < 10) - 0.1 * (k % 20 >= 10), np.deg2rad(5.0))))
    assert not any(said)


def test_a_map_is_not_rescued_for_ever():
    config = DiagnosisConfig(rescues=8, within=12)
    said = drive(FaultsConfig(), 1, 12, config=config)
    assert not any(said[:7])
    assert said[7].startswith("8 of the last 8 scans")
    assert not any(drive(FaultsConfig(), 1, 12, config=config, every=100))


def test_nothing_is_tried_unless_the_map_fits_badly():
    assert not any(drive(FaultsConfig(mirrored=True), 1, 30, every=100))


def test_a_scan_that_is_the_last_one_again_tells_nothing():
    robot, diagnosis = SimulatedRobot(ROOMS, 1), Diagnosis()
    scan = robot.sense()
    diagnosis.see(scan, False, False)
    assert not diagnosis.repeats(scan)
    diagnosis.moved(Odometry(np.array([0.1, 0.0, 0.0]), 1e-6 * np.eye(3)))
    assert diagnosis.repeats(scan)
    assert not diagnosis.repeats(robot.sense())
    assert not diagnosis.repeats(replace(scan, ranges_m=np.full_like(scan.ranges_m, np.inf)))


def test_motions_that_scans_have_told_are_not_judged():
    robot, diagnosis = SimulatedRobot(ROOMS, 1, config=RobotConfig(faults=FaultsConfig(mirrored=True))), Diagnosis()
    said = []
    for k in range(20):
        said.append(diagnosis.see(robot.sense(), k < 15, True))
        odometry = robot.drive(MotionCommand(0.05, 0.15))
        diagnosis.moved(replace(odometry, wheels=odometry))
    assert not any(said)


@pytest.mark.parametrize("mount", MOUNTS)
def test_motions_are_expected_as_mounting_has_them(mount):
    rng, moved = np.random.default_rng(0), []
    for _ in range(6):
        A = rng.normal(size=(3, 3))
        moved.append(Odometry(rng.uniform(-0.2, 0.2, 3), 1e-4 * A @ A.T))
    motions, covs = np.array([each.motion for each in moved]), np.array([each.cov for each in moved])
    faults = [
        Fault(),
        Fault(0.2, -0.1),
        Fault(turned_rad=0.7),
        Fault(late=2),
        Fault(is_mirrored=True),
        Fault(stands=True),
    ]
    found = expected(faults, motions, covs, mount)
    for k, fault in enumerate(faults[:3]):
        sits = ScannerSpec(mount.x_m + fault.ahead_m, mount.y_m + fault.left_m, mount.heading_rad + fault.turned_rad)
        for each, motion, cov in zip(moved, found[0][k], found[1][k], strict=True):
            told = odometry_of_scanner(each, sits)
            np.testing.assert_allclose(motion, told.motion, atol=1e-12)
            np.testing.assert_allclose(cov, told.cov, atol=1e-12)
    sound, late, mirrored, stands = found[0][[0, 3, 4, 5]]
    assert np.isnan(late[:2]).all()
    np.testing.assert_array_equal(late[2:], sound[:-2])
    np.testing.assert_array_equal(mirrored, sound * [1.0, -1.0, -1.0])
    assert not stands.any()


def test_what_two_scans_tell_of_a_motion_is_as_sure_as_they_say():
    """Along a bare corridor they tell nothing, and say so."""
    square, errors = World("square", _box(5.0, 4.0), np.array([2.0, 1.5, 0.3]), {}), []
    for seed in range(40):
        robot = SimulatedRobot(square, seed, config=RobotConfig(lidar=LidarConfig(beams=360, range_max_m=8.0)))
        before, start = robot.sense(), robot.true_pose
        robot.drive(MotionCommand(0.1, 0.1))
        guess = np.random.default_rng(seed).uniform(-0.1, 0.1, 3)
        motion, information = told_by_scans(before, robot.sense(), guess, 0.4, 0.5)
        off = motion - _between(start, robot.true_pose)
        errors.append(off @ information @ off)
    assert np.mean(errors) < 3.0 * 1.3
    corridor = World("corridor", _box(60.0, 1.4), np.array([30.0, 0.7, 0.0]), {})
    robot = SimulatedRobot(corridor, 1)
    before = robot.sense()
    robot.drive(MotionCommand(0.15, 0.0))
    _, information = told_by_scans(before, robot.sense(), np.zeros(3), 0.4, 0.5)
    sigma = np.sqrt(np.diag(np.linalg.inv(information)))
    assert sigma[0] > 0.1
    assert sigma[1] < 0.03


def _box(x, y):
    return shapely.orient_polygons(shapely.box(0.0, 0.0, x, y))


def _between(start, end):
    return compose(inverse(start), end)


def test_faults_of_all_kinds_are_tried():
    tried = tried_first()
    assert {each.late for each in tried} == {0, 1, 2, 3}
    assert Fault() not in tried
    for degrees in range(-180, 180, 7):
        off = [abs(np.rad2deg(each.turned_rad) - degrees + 180) % 360 - 180 for each in tried if each.turned_rad]
        assert min(map(abs, off)) <= 5.1 or abs(degrees) < 5.1
