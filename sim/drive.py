"""Differential drive: the odometry reports the commanded arc, and the robot slips off it."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.robot import MotionCommand, Odometry, RobotSpec, WheelSpec


@dataclass(frozen=True)
class Slip:
    """Deviation of one step's true motion from the commanded one."""

    left_m: float
    right_m: float
    lateral_m: float
    """Sideways, to the left of the middle of the arc."""


def clamp(command: MotionCommand, robot: RobotSpec) -> MotionCommand:
    """Return the command scaled by one factor to the longest step and the widest turn: the same arc, shortened.

    A robot that cannot reverse turns on the spot instead. Raises ValueError for a command that is not finite.
    """
    forward, turn = abs(command.forward_m), abs(command.turn_rad)
    if not (np.isfinite(forward) and np.isfinite(turn)):
        raise ValueError(f"expected a finite command, found {command}: look where the planner divides")
    if command.forward_m < 0.0 and not robot.can_reverse:
        command, forward = MotionCommand(0.0, command.turn_rad), 0.0
    share = min(1.0, robot.step_m / max(forward, 1e-12), robot.turn_rad / max(turn, 1e-12))
    return MotionCommand(share * command.forward_m, share * command.turn_rad)


def seconds(command: MotionCommand, config: WheelSpec, speed_m_s: float) -> float:
    """Return the duration of the command, s, if the faster wheel moves at this speed."""
    return max(abs(way) for way in config.ways(command.forward_m, command.turn_rad)) / speed_m_s


def draw_slip(command: MotionCommand, config: WheelSpec, standard_normals: Float[np.ndarray, "3"]) -> Slip:
    """Return the slip of one step from three standard normal draws."""
    left, right, lateral = np.sqrt(config.slip_variances(command.forward_m, command.turn_rad)) * standard_normals
    return Slip(float(left), float(right), float(lateral))


def true_motion(
    command: MotionCommand, slip: Slip, config: WheelSpec, shares: Float[np.ndarray, " n"]
) -> Float[np.ndarray, "n 3"]:
    """Return the poses of the slipping robot after these shares of its step: (n, 3) m m rad from its start."""
    forward = command.forward_m + 0.5 * (slip.left_m + slip.right_m)
    turn = command.turn_rad + (slip.right_m - slip.left_m) / config.base_m
    half = 0.5 * turn * shares
    chord = forward * shares * np.sinc(half / np.pi)
    sideways = slip.lateral_m * shares
    cos, sin, poses = np.cos(half), np.sin(half), np.empty((len(shares), 3))
    poses[:, 0], poses[:, 1], poses[:, 2] = chord * cos - sideways * sin, chord * sin + sideways * cos, turn * shares
    return poses


def odometry(command: MotionCommand, config: WheelSpec) -> Odometry:
    """Return the odometry: the commanded arc and its first-order covariance, in the robot frame before it."""
    return config.over_arc(command.forward_m, command.turn_rad)
