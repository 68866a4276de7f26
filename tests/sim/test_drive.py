from dataclasses import replace

import numpy as np
import pytest

from chainslam.sim.chance import Chance, Channel
from chainslam.sim.drive import Slip, clamp, draw_slip, odometry, seconds, true_motion
from chainslam.slam.geometry.poses import arc
from chainslam.slam.robot import MotionCommand, RobotSpec

ROBOT = RobotSpec()
CONFIG = ROBOT.wheels
COMMANDS = [
    MotionCommand(0.15, 0.0),
    MotionCommand(0.1, 0.17),
    MotionCommand(0.0, -0.15),
    MotionCommand(-0.05, 0.1),
    MotionCommand(0.02, 0.1),
    MotionCommand(0.0, 0.0),
]
WHOLE = np.ones(1)


@pytest.mark.parametrize("command", COMMANDS)
def test_without_slip_the_true_motion_is_the_commanded_arc(command):
    motion = true_motion(command, Slip(0.0, 0.0, 0.0), CONFIG, WHOLE)[0]
    np.testing.assert_allclose(motion, arc(command.forward_m, command.turn_rad), atol=1e-15)
    np.testing.assert_allclose(odometry(command, CONFIG).motion, motion, atol=1e-15)


@pytest.mark.parametrize("command", COMMANDS)
def test_a_share_of_a_slipping_step_is_a_step_of_shares(command):
    """Half of the way turns half as far: each part of command and slip is that share of it."""
    slip, shares = Slip(0.011, -0.007, 0.005), np.array([0.25, 0.5, 1.0])
    part = lambda of, share: type(of)(*(share * value for value in vars(of).values()))  # noqa: E731
    expected = [true_motion(part(command, share), part(slip, share), CONFIG, WHOLE)[0] for share in shares]
    np.testing.assert_allclose(true_motion(command, slip, CONFIG, shares), expected, atol=1e-15)


@pytest.mark.parametrize(("way", "turn"), [(0.3, 0.0), (-0.3, 0.0), (0.0, 0.5), (0.1, -0.2), (-0.1, -0.2)])
def test_a_step_takes_as_long_as_its_faster_wheel_needs(way, turn):
    farthest = abs(way) + 0.5 * CONFIG.base_m * abs(turn)
    assert seconds(MotionCommand(way, turn), CONFIG, 0.25) == pytest.approx(4.0 * farthest)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_stated_covariance_is_the_first_order_one(command):
    step = 1e-6
    columns = []
    for row in step * np.eye(3):
        ahead = true_motion(command, Slip(*row), CONFIG, WHOLE)[0]
        behind = true_motion(command, Slip(*-row), CONFIG, WHOLE)[0]
        columns.append((ahead - behind) / (2 * step))
    jacobian = np.stack(columns, axis=-1)
    unit = np.array([vars(draw_slip(command, CONFIG, row)) for row in np.eye(3)])
    sigma = np.array([sum(draw.values()) for draw in unit])
    expected = jacobian @ np.diag(sigma**2) @ jacobian.T + CONFIG.floor**2 * np.eye(3)
    np.testing.assert_allclose(odometry(command, CONFIG).cov, expected, atol=1e-13)


@pytest.mark.parametrize("command", COMMANDS)
def test_the_covariance_is_positive_definite_even_at_rest(command):
    cov = odometry(command, CONFIG).cov
    np.testing.assert_array_equal(cov, cov.T)
    assert np.linalg.eigvalsh(cov).min() > 0.5 * CONFIG.floor**2


def test_nees_of_the_motion_is_chi_square():
    command = MotionCommand(0.15, 0.1)
    reported = odometry(command, CONFIG)
    draws = np.random.default_rng(1).standard_normal((20_000, 3))
    motions = np.stack([true_motion(command, draw_slip(command, CONFIG, d), CONFIG, WHOLE)[0] for d in draws[:4000]])
    errors = motions - reported.motion
    nees = np.einsum("ni,ij,nj->n", errors, np.linalg.inv(reported.cov), errors)
    assert np.mean(nees) == pytest.approx(3.0, abs=4 * np.sqrt(6 / 4000))


@pytest.mark.parametrize("command", [MotionCommand(1.0, 0.1), MotionCommand(0.1, -2.0), MotionCommand(-3.0, 3.0)])
def test_clamping_keeps_the_arc_and_shortens_it(command):
    short = clamp(command, ROBOT)
    assert abs(short.forward_m) <= ROBOT.step_m * (1 + 1e-12)
    assert abs(short.turn_rad) <= ROBOT.turn_rad * (1 + 1e-12)
    assert short.forward_m * command.turn_rad == pytest.approx(command.forward_m * short.turn_rad)
    assert clamp(short, ROBOT).forward_m == pytest.approx(short.forward_m)


def test_a_command_within_what_the_robot_can_do_stays_as_it_is():
    for command in COMMANDS:
        assert clamp(command, replace(ROBOT, can_reverse=True)) == command


def test_a_robot_that_cannot_reverse_turns_on_the_spot_and_drives_ahead_as_any_other():
    onward = replace(ROBOT, can_reverse=False)
    assert clamp(MotionCommand(-0.05, 0.1), onward) == MotionCommand(0.0, 0.1)
    assert clamp(MotionCommand(-99.0, 0.1), onward) == MotionCommand(0.0, 0.1)
    assert clamp(MotionCommand(0.05, 0.1), onward) == MotionCommand(0.05, 0.1)


def test_a_command_that_is_not_finite_is_refused():
    with pytest.raises(ValueError, match="finite"):
        clamp(MotionCommand(float("nan"), 0.0), ROBOT)


def test_turning_in_place_moves_the_wheels_against_each_other():
    left, right = CONFIG.ways(0.0, 0.1)
    assert left == -right
    assert right == pytest.approx(0.02)


def test_streams_are_keyed_and_independent_of_each_other():
    draws = {
        (world, seed, channel, step): Chance(seed, world).standard_normals(channel, step, 3).tobytes()
        for world in (0, 1, 2**64 - 1)
        for seed in (0, 1)
        for channel in Channel
        for step in range(3)
    }
    assert len(set(draws.values())) == len(draws)
    assert Chance(1, 0).standard_normals(Channel.LASER, 2, 3).tobytes() == draws[(0, 1, Channel.LASER, 2)]
    with pytest.raises(ValueError, match="seed"):
        Chance(-1, 0).standard_normals(Channel.LASER, 0, 3)


def test_draws_over_many_steps_are_standard_normal():
    draws = np.concatenate([Chance(3, 0).standard_normals(Channel.LASER, step, 50) for step in range(400)])
    assert abs(draws.mean()) < 4 / np.sqrt(len(draws))
    assert draws.var() == pytest.approx(1.0, abs=4 * np.sqrt(2 / len(draws)))
