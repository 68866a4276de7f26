"""A command never drives farther than it says, whatever scanner, motors, encoders and clocks do."""

import time
from contextlib import suppress

import numpy as np
import pytest

from chainslam.slam.robot import MotionCommand, RobotError
from chainslam.slam.robot.streaming import SteppedRobot, Twist
from tests.slam.streaming_base import COV, StreamingBase

COMMANDS = [MotionCommand(0.15, 0.0), MotionCommand(0.0, -0.17), MotionCommand(-0.1, 0.1)]
ONE = [COMMANDS[0], *(pytest.param(c, marks=pytest.mark.long) for c in COMMANDS[1:])]
LEAST, MOST = 0.13 / 0.15, 0.17 / 0.15
KINDS = {
    "10 Hz, one stamp": {},
    "30 Hz, one stamp": {"hz": 30.0},
    "40 Hz over 270 degrees": {"hz": 40.0, "degrees": 270.0},
    "a sector": {"degrees": 120.0},
    "one scan a second": {"hz": 1.0},
    "a slow turning scanner": {"hz": 3.5, "turns": True},
    "scans that come late": {"scan_late_s": 0.3},
    "scans that get lost": {"every": 4},
    "a base that stops after 0.2 s": {"timeout_s": 0.2},
    "a base that stops after 0.5 s": {"timeout_s": 0.5, "hz": 3.0},
    "a base that obeys late": {"obeys_late_s": 0.3},
    "a heavy base": {"inertia_s": 0.2},
    "a base that goes on after a stop": {"coasts_s": 0.3},
    "a base of half as fast again": {"gain": 1.5},
    "a base that is a fifth too slow": {"gain": 0.8},
    "motors that do not turn slowly": {"least_m_s": 0.03},
    "late odometry": {"odom_late_s": 0.2},
    "odometry that waits until it knows": {"odom_late_s": 0.2, "waits": True},
    "slow odometry": {"odom_hz": 5.0},
    "slow and late odometry between whose samples nothing is told, fast scans": {
        "odom_hz": 5.0, "odom_late_s": 0.3, "holds": True, "hz": 40.0,
    },
}  # fmt: skip


def driven(base, command, **options):
    """Return what one command made of the robot as shares of it (where it asks for any), and the odometry."""
    stepped = SteppedRobot(base, clock=base.clock, **options)
    stepped.sense()
    start_s = base.now_s
    odometry = stepped.drive(command)
    base.go_on(0.5)
    return shares(base, command, start_s), odometry


def shares(base, command, start_s=0.0):
    forward, turn = base.moved(start_s)
    asked = ((command.forward_m, forward), (command.turn_rad, turn))
    return [went / told for told, went in asked if told]


@pytest.mark.parametrize("command", ONE)
@pytest.mark.parametrize("kind", KINDS)
def test_a_command_is_driven_as_far_as_it_says(kind, command):
    base = StreamingBase(**KINDS[kind])
    went, odometry = driven(base, command)
    assert all(LEAST <= share <= MOST for share in went), went
    assert odometry.motion[2] == pytest.approx(command.turn_rad, abs=0.025)
    assert base.twist == Twist(0.0, 0.0)


@pytest.mark.parametrize("seed", [*range(10), *(pytest.param(s, marks=pytest.mark.long) for s in range(10, 150))])
def test_so_it_is_where_all_that_comes_together(seed):
    rng = np.random.default_rng([49, seed])
    base = StreamingBase(
        hz=rng.choice([10.0, 17.0, 30.0, 40.0]), beams=8, turns=rng.random() < 0.5, scan_late_s=rng.uniform(0.0, 0.1),
        every=int(rng.integers(1, 3)), odom_hz=rng.choice([20.0, 50.0, 100.0]), odom_late_s=rng.uniform(0.0, 0.2),
        waits=rng.random() < 0.5, timeout_s=rng.choice([0.2, 0.35, np.inf]), obeys_late_s=rng.uniform(0.0, 0.15),
        inertia_s=rng.uniform(0.0, 0.15), gain=rng.uniform(0.9, 1.2), coasts_s=rng.uniform(0.0, 0.15), seed=seed,
    )  # fmt: skip
    stepped = SteppedRobot(base, clock=base.clock)
    for command in COMMANDS:
        stepped.sense()
        start_s = base.now_s
        stepped.drive(command)
        base.go_on(0.5)
        went = shares(base, command, start_s)
        assert all(LEAST <= share <= MOST for share in went), went


@pytest.mark.parametrize("command", ONE)
@pytest.mark.parametrize("dies_s", [0.0, 0.45, 0.6])
@pytest.mark.parametrize("encoders", [1, 2])
def test_an_encoder_that_dies_lets_nothing_run_away(encoders, dies_s, command):
    base = StreamingBase(encoders=encoders, dies_s=dies_s)
    with suppress(RobotError):
        driven(base, command)
    base.go_on(0.5)
    assert all(share <= MOST for share in shares(base, command))


@pytest.mark.parametrize("silence", ["blocks", "none", "same", "raises"])
@pytest.mark.parametrize("command", ONE)
def test_a_stream_that_goes_silent_stops_the_robot_in_time(silence, command):
    base = StreamingBase(silent_s=0.6, silence=silence)
    before_s = time.monotonic()
    with pytest.raises(RobotError, match=r"expected a new scan, found (none|the one of 0.500 s again) within 0.1 s"):
        driven(base, command, wait_s=0.1)
    assert time.monotonic() - before_s < 10.0
    base.go_on(1.0)
    assert base.stops > 0
    assert base.twist == Twist(0.0, 0.0)
    assert all(share <= MOST for share in shares(base, command))


def test_odometry_that_goes_silent_stops_the_robot_in_time():
    base = StreamingBase(odometry_silent_s=0.6)
    with pytest.raises(RobotError, match=r"expected odometry up to 0.600 s, found none within 0.1 s"):
        driven(base, MotionCommand(0.15, 0.0), wait_s=0.1)
    base.go_on(1.0)
    assert base.twist == Twist(0.0, 0.0)
    assert base.moved()[0] < 0.17


def test_a_robot_that_waits_for_its_first_scan_has_longer(monkeypatch):
    monkeypatch.setattr("chainslam.slam.robot.scan_stream.START_S", 0.15)
    base = StreamingBase(silent_s=0.0, silence="none")
    base.last = base.scan()
    base.silence = "blocks"
    with pytest.raises(RobotError, match=r"found none within 0\.15 s"):
        SteppedRobot(base, wait_s=0.05).sense()
    assert base.stops == 1


@pytest.mark.parametrize(
    ("fault", "found"),
    [
        ({"gain": 4.0, "hz": 1.0}, r"found 0\.2\d\d m"),
        ({"creeps_m_s": 0.05}, r"found 0\.(19|20)\d m"),
        ({"gain": -1.0}, r"found -0\.0\d\d m"),
        ({"bumps_s": 0.6}, r"found 0\.\d\d\d m and 40\.\d degrees"),
    ],
)
def test_what_goes_too_far_is_stopped_with_the_figure(fault, found):
    base = StreamingBase(**fault)
    with pytest.raises(RobotError, match=rf"expected a drive of 0.150 m and 0.0 degrees, {found}"):
        driven(base, MotionCommand(0.15, 0.0))
    base.go_on(0.5)
    assert base.twist == Twist(0.0, 0.0)


def test_a_base_that_cannot_be_stopped_is_told():
    base = StreamingBase(creeps_m_s=0.012)
    with pytest.raises(RobotError, match=r"expected a robot that stands after a stop, found 0\.004 m"):
        driven(base, MotionCommand(0.15, 0.0))


def test_a_stuck_base_is_told_its_command_once_and_found_out_at_the_third():
    base = StreamingBase(stuck_s=0.0)
    stepped = SteppedRobot(base, clock=base.clock)
    stepped.sense()
    for _ in range(2):
        np.testing.assert_allclose(stepped.drive(MotionCommand(0.15, 0.0)).motion, 0.0, atol=1e-12)
    with pytest.raises(RobotError, match="expected a robot that moves, found one that stood still at 3 commands"):
        stepped.drive(MotionCommand(0.15, 0.0))


def test_while_it_waits_the_twist_is_sent_again(monkeypatch):
    monkeypatch.setattr("chainslam.slam.robot.scan_stream.REPEAT_S", 0.01)
    base, sent = StreamingBase(), []
    scan, send = base.scan, base.send

    def slow():
        sent.append(None)
        time.sleep(0.04)
        return scan()

    monkeypatch.setattr(base, "scan", slow)
    monkeypatch.setattr(base, "send", lambda twist: (sent.append(twist), send(twist)))
    stepped = SteppedRobot(base, clock=base.clock)
    stepped.sense()
    stepped.drive(MotionCommand(0.15, 0.0))
    waits = "".join("s" if twist is None else "t" for twist in sent).strip("s").split("s")
    assert sum(map(len, waits)) > 2 * len(waits), "two and more for each scan on the way"


def test_what_lasted_long_enough_is_stopped_though_no_scan_comes(monkeypatch):
    monkeypatch.setattr("chainslam.slam.robot.scan_stream.REPEAT_S", 0.01)
    base, told = StreamingBase(), []
    stepped = SteppedRobot(base, wait_s=1.5, speed_m_s=0.5)
    for _ in range(2):
        stepped.sense()
        stepped.drive(MotionCommand(0.15, 0.0))
    base.silent_s = base.now_s + 0.15
    monkeypatch.setattr(base, "send", lambda twist: told.append((time.monotonic(), twist)))
    monkeypatch.setattr(base, "stop", lambda: told.append((time.monotonic(), None)))
    with pytest.raises(RobotError, match="expected a new scan"):
        stepped.drive(MotionCommand(0.15, 0.0))
    sent = [at_s for at_s, twist in told if twist is not None]
    stopped = next(at_s for at_s, twist in told if twist is None and at_s > sent[0])
    assert sent[-1] < stopped < sent[0] + 0.9


def test_a_bumper_ends_the_command():
    base = StreamingBase()
    odometry = base.odometry

    def touched(from_s, to_s):
        told = odometry(from_s, to_s)
        return type(told)(told.motion, COV, touched=to_s > 0.45)

    base.odometry = touched
    went, _ = driven(base, MotionCommand(0.15, 0.0))
    assert went[0] < 0.6


@pytest.mark.parametrize("end_s", [np.nan, 0.05])
def test_scans_without_times_that_go_on_are_refused(end_s, monkeypatch):
    base = StreamingBase()
    stepped = SteppedRobot(base, clock=base.clock)
    stepped.sense()
    last = base.last
    monkeypatch.setattr(base, "scan", lambda: type(last)(last.bearings_rad, last.ranges_m, 0.01, 8.0, 0.0, end_s))
    with pytest.raises(
        RobotError, match=r"expected (a scan with the time of its end|scans whose times go on from 0.100)"
    ):
        stepped.drive(MotionCommand(0.15, 0.0))
    assert base.stops == 1


@pytest.mark.parametrize("name", ["speed_m_s", "turn_rad_s", "wait_s"])
def test_speeds_and_patience_are_checked(name):
    with pytest.raises(RobotError, match=f"expected a {name} above 0 and finite, found -1"):
        SteppedRobot(StreamingBase(), **{name: -1.0})
