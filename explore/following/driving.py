"""From a path to one safe motion command; safe by the raw scan, also where the map is wrong."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import arc, to_robot
from chainslam.slam.robot import MotionCommand, Scan
from chainslam.slam.robot.body import rim_of

from ..floor.accumulated_returns import returns, steadied
from ..floor.free_space import FreeSpace
from ..planning.paths import Path, Planner
from .driving_config import DrivingConfig
from .safe_steps import FACING_RAD, centred, is_safe, step_away, step_towards, turn_towards

_NOTHING = np.zeros((0, 2))
_RIM = np.stack([np.cos(np.arange(24) * np.pi / 12), np.sin(np.arange(24) * np.pi / 12)], axis=-1)
"""Points of the rim of a disc of radius one, every fifteen degrees."""


class Pilot:
    """Drives along one path."""

    def __init__(self, path: Path, planner: Planner, config: DrivingConfig) -> None:
        self._points = path.points_world
        self._planner, self._config = planner, config
        self._at = 0
        self._rows_ahead = 10
        self._lookahead_m, self._full_again_at = config.lookahead_m, 0

    @property
    def remaining_m(self) -> float:
        """Length of the path from the nearest point on it to its end."""
        ahead = np.diff(self._points[self._at :], axis=0)
        return float(np.sum(np.hypot(ahead[:, 0], ahead[:, 1])))

    @property
    def destination_world(self) -> Float[np.ndarray, "2"]:
        """Where the path ends, m."""
        return self._points[-1]

    @property
    def squeeze_world(self) -> Float[np.ndarray, "2"] | None:
        """Where, within the next half metre of the path, there is hardly room for the body; None if nowhere."""
        ahead = self._points[self._at : self._at + self._rows_ahead]
        tight = np.flatnonzero(~self._planner.has_room(ahead))
        return ahead[tight[len(tight) // 2]] if len(tight) else None

    def arrived(self, pose_world: Float[np.ndarray, "3"]) -> bool:
        """Return whether the robot stands at the end of the path."""
        return float(np.hypot(*(self._points[-1] - pose_world[:2]))) < self._config.arrived_m

    def is_obstructed(self, pose_world: Float[np.ndarray, "3"], scan: Scan) -> bool:
        """Return whether a return of this scan lies on the next metre of the path."""
        ahead = self._points[self._at : self._at + 2 * self._rows_ahead]
        # What is beside the robot already is no matter of the path: `command` gets away from it.
        ahead = ahead[np.hypot(*(ahead - pose_world[:2]).T) > self._config.robot.step_m]
        gap = to_robot(ahead, pose_world)[:, None] - returns(scan, self._config.robot.scanner)
        return bool(gap.size) and float(np.hypot(gap[..., 0], gap[..., 1]).min()) < self._config.obstructed_m

    def command(
        self,
        pose_world: Float[np.ndarray, "3"],
        scan: Scan,
        free_space: FreeSpace,
        recent_robot: Float[np.ndarray, "r 2"] = _NOTHING,
        touched_robot: Float[np.ndarray, "t 2"] = _NOTHING,
    ) -> MotionCommand | None:
        """Return the next step along the path, or None where no safe one leads on.

        `recent_robot` are returns of the last scans, in the robot's frame of now: they count where there is room. In
        a narrow place the noise of so many would leave none. What the body touched, `touched_robot`, always
        counts.
        """
        seen = ahead_of(
            self._aim(pose_world, self._config.lookahead_m), scan, recent_robot, touched_robot, self._config
        )
        aim, points, narrow = seen.aim_robot, seen.points_robot, seen.fits
        if seen.gap_m < self._config.narrow_m:
            command = step_towards(aim, points, self._config, narrow)
        else:
            command = self._clear_step(aim, pose_world, points)
        if command is not None:
            return careful(command, pose_world, free_space, self._config)
        if narrow and self._config.robot.can_reverse:
            back = MotionCommand(-self._config.slow_m, 0.0)
            return back if is_safe(back, points, self._config, narrow) else None
        turn = turn_towards(aim, self._config)
        return step_away(points, self._config) or (MotionCommand(0.0, turn) if abs(turn) > FACING_RAD else None)

    def _clear_step(
        self,
        ahead_robot: Float[np.ndarray, "2"],
        pose_world: Float[np.ndarray, "3"],
        points_robot: Float[np.ndarray, "m 2"],
    ) -> MotionCommand | None:
        """Return a safe step towards the point ahead on the path, if need be a nearer one, or None where there is none.

        The straight way to it leaves the path where that bends round something; the nearer the point, the closer the
        robot keeps to the path.
        """
        lookahead_m, aim = self._config.lookahead_m, ahead_robot
        if self._at < self._full_again_at:
            lookahead_m, aim = self._lookahead_m, self._aim(pose_world, self._lookahead_m)
        while (command := step_towards(aim, points_robot, self._config, narrow=False)) is None:
            if lookahead_m <= self._config.least_lookahead_m:
                return None
            lookahead_m *= 0.5
            aim = self._aim(pose_world, lookahead_m)
            self._lookahead_m, self._full_again_at = lookahead_m, self._at + self._config.short_points
        return command

    def _aim(self, pose_world: Float[np.ndarray, "3"], lookahead_m: float) -> Float[np.ndarray, "2"]:
        """Return the farthest point of the path within the lookahead to which the way is clear, robot frame, m."""
        position_world = pose_world[:2]
        gaps = np.hypot(*(self._points[self._at : self._at + 40] - position_world).T)
        self._at += int(np.argmin(gaps))
        ahead = self._points[self._at :]
        along = np.concatenate([[0.0], np.cumsum(np.hypot(*np.diff(ahead, axis=0).T))])
        last = int(np.searchsorted(along, lookahead_m, side="right")) - 1
        clear = (row for row in range(last, 0, -1) if self._planner.clear_ahead(position_world, ahead[row]))
        return to_robot(ahead[next(clear, min(2, len(ahead) - 1))][None], pose_world)[0]


@dataclass(frozen=True, eq=False)
class Ahead:
    """What lies between the robot and its aim."""

    aim_robot: Float[np.ndarray, "2"]
    """Robot frame, m; in a narrow gap moved to its middle."""
    points_robot: Float[np.ndarray, "m 2"]
    """The returns from which the body keeps clear, robot frame, m."""
    gap_m: float
    """Between the returns on both sides; infinite without returns on both."""
    fits: bool
    """Whether the gap is narrow and the body fits through it."""


def ahead_of(
    aim_robot: Float[np.ndarray, "2"],
    scan: Scan,
    recent_robot: Float[np.ndarray, "r 2"],
    touched_robot: Float[np.ndarray, "t 2"],
    config: DrivingConfig,
) -> Ahead:
    """Return what lies on the way to an aim, by this scan, the returns of the last ones and what the body touched."""
    points = returns(scan, config.robot.scanner)
    aim, gap_m, narrow = centred(aim_robot, points, config)
    if gap_m < config.narrow_m:
        steady = steadied(scan, recent_robot, config.robot)
        aim, gap_m, narrow = centred(aim_robot, steady, config)
    kept = [steady, touched_robot] if narrow else [points, recent_robot, touched_robot]
    return Ahead(aim, np.concatenate(kept), gap_m, narrow)


def careful(
    command: MotionCommand, pose_world: Float[np.ndarray, "3"], free_space: FreeSpace, config: DrivingConfig
) -> MotionCommand:
    """Shorten a step whose end would cover floor that was not seen yet."""
    x, y, turn = arc(command.forward_m, command.turn_rad)
    c, s = np.cos(pose_world[2]), np.sin(pose_world[2])
    end = pose_world[:2] + np.array([c * x - s * y, s * x + c * y])
    rim = config.radius_m * _RIM if config.robot.outline_m is None else rim_of(config.robot, pose_world[2] + turn)
    if np.any(free_space.unknown_at(end + rim)):
        return MotionCommand(min(command.forward_m, config.slow_m), command.turn_rad)
    return command
