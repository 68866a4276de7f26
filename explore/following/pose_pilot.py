"""Along a path of places and headings, for a body whose outline is no disc: the arc that gets farthest and is safe."""

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import arc, inverse, to_robot, wrap
from chainslam.slam.robot import MotionCommand, Scan
from chainslam.slam.robot.body import depths_m, reaches_m

from ..floor.accumulated_returns import returns, steadied
from ..floor.free_space import FreeSpace
from ..planning.paths import Path, Planner
from .driving import Pilot, careful
from .driving_config import DrivingConfig
from .safe_steps import least_gap

SHARES = (-1.0, -0.5, -0.25, -0.1, 0.0, 0.1, 0.25, 0.5, 1.0)
"""Of the longest step and the widest turn: the arcs that are tried."""
TURN_M = 0.25
"""A radian of turn is as far off a path as so much way."""
ASTRAY, WIDE = 3.0, 4.0
"""A metre off the path is worth so many metres along it, one more beside the body, where it is narrow, so many."""
SWING_SIGMAS = 2.0
"""So far the farthest corner swings out where the wheels slip: a short step less than a long one."""
EVERY_M = 0.0125
"""Poses along the path: a step that leads a little way along it gets on."""
AHEAD_M = 0.5
"""So much of the path ahead is looked at: two to four steps."""
LEAST_M = 0.004
"""A step that gets less far than this is none."""
NEAR_M = 1.0
"""Returns this far off the body are in the way of no pose that is looked at."""
_NOTHING = np.zeros((0, 2))


class PosePilot(Pilot):
    """Drives along one path with headings."""

    def __init__(self, path: Path, planner: Planner, config: DrivingConfig) -> None:
        super().__init__(path, planner, config)
        assert path.headings_rad is not None
        self._poses, self._metres = _densely(np.column_stack([path.points_world, path.headings_rad]))
        self._points = self._poses[:, :2]
        self._rows_ahead = int(AHEAD_M / EVERY_M)

    @property
    def remaining_m(self) -> float:
        """Length of the path from the nearest point on it to its end, turns counted."""
        return float(self._metres[-1] - self._metres[self._at])

    def is_obstructed(self, pose_world: Float[np.ndarray, "3"], scan: Scan) -> bool:
        """Return whether a return of this scan lies within the body at one of the next poses."""
        ahead = self._poses[self._at : self._at + self._rows_ahead : 4]
        ahead = ahead[np.hypot(*(ahead[:, :2] - pose_world[:2]).T) > self._config.robot.step_m]
        points = returns(scan, self._config.robot.scanner)
        points = points[reaches_m(points, self._config.robot) < self._config.radius_m + NEAR_M]
        if not len(ahead) or not len(points):
            return False
        back = inverse(pose_world)
        c, s = np.cos(back[2]), np.sin(back[2])
        at = np.column_stack([ahead[:, :2] @ np.array([[c, s], [-s, c]]) + back[:2], ahead[:, 2] + back[2]])
        within = [depths_m(to_robot(points, pose), self._config.robot).max() for pose in at]
        return bool(max(within) > self._config.obstructed_within_m)

    def command(
        self,
        pose_world: Float[np.ndarray, "3"],
        scan: Scan,
        free_space: FreeSpace,
        recent_robot: Float[np.ndarray, "r 2"] = _NOTHING,
        touched_robot: Float[np.ndarray, "t 2"] = _NOTHING,
    ) -> MotionCommand | None:
        """Return the safe arc that gets farthest along the path, or None where none gets on."""
        config, robot = self._config, self._config.robot
        self._at += int(np.argmin(_off(pose_world[None], self._poses[self._at : self._at + self._rows_ahead])[0]))
        points = returns(scan, robot.scanner)
        # Beside two walls the nearest of many noisy returns leave no room: their mean tells where they stand.
        narrow = bool(len(points)) and bool(
            reaches_m(points, robot).min() < config.radius_m + 0.5 * config.narrow_beyond_m
        )
        kept = [steadied(scan, recent_robot, robot)] if narrow else [points, recent_robot]
        points = np.concatenate([*kept, touched_robot])
        commands = _arcs(config, narrow)
        ends = np.array([arc(each.forward_m, each.turn_rad) for each in commands])
        c, s = np.cos(pose_world[2]), np.sin(pose_world[2])
        ends = np.column_stack([ends[:, :2] @ np.array([[c, s], [-s, c]]) + pose_world[:2], ends[:, 2] + pose_world[2]])
        gains = self._gained(ends) - self._gained(pose_world[None])[0]
        near = points[np.hypot(*points.T) < config.radius_m + config.robot.step_m + NEAR_M]
        now_m = float(reaches_m(near, robot).min(initial=np.inf))
        best, worth = None, -np.inf
        for row in np.flatnonzero(gains > LEAST_M).tolist():
            least_m = least_gap(commands[row], near, robot)
            wide_m = min(least_m - config.radius_m, 0.5 * config.narrow_beyond_m) if narrow else 0.0
            if gains[row] + WIDE * wide_m > worth and self._is_safe(commands[row], least_m, now_m, narrow):
                best, worth = commands[row], gains[row] + WIDE * wide_m
        return None if best is None else careful(best, pose_world, free_space, config)

    def _is_safe(self, command: MotionCommand, least_m: float, now_m: float, narrow: bool) -> bool:
        """Return whether a step keeps its margin, or comes no nearer to anything, though the wheels slip on it."""
        config = self._config
        slip_rad = float(np.sqrt(config.robot.wheels.over_arc(command.forward_m, command.turn_rad).cov[2, 2]))
        left_m = least_m - config.radius_m * (1.0 + SWING_SIGMAS * slip_rad)
        margin_m = config.narrow_margin_m if narrow else config.margin_m
        return left_m >= margin_m or (least_m >= now_m and left_m >= config.least_margin_m)

    def _gained(self, poses_world: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, " n"]:
        """Return how far along the path some poses are, less what they are off it, m."""
        rows = slice(self._at, self._at + self._rows_ahead)
        return (self._metres[rows] - ASTRAY * _off(poses_world, self._poses[rows])).max(axis=1)


def _off(poses: Float[np.ndarray, "n 3"], others: Float[np.ndarray, "m 3"]) -> Float[np.ndarray, "n m"]:
    """Return how far poses are from others, a turn counted as way, m."""
    apart = poses[:, None] - others
    return np.hypot(apart[..., 0], apart[..., 1]) + TURN_M * np.abs(wrap(apart[..., 2]))


def _densely(poses: Float[np.ndarray, "n 3"]) -> tuple[Float[np.ndarray, "m 3"], Float[np.ndarray, " m"]]:
    """Return poses on the straight ways and turns between some, and how far along each of them is, m."""
    apart = np.diff(poses, axis=0)
    apart[:, 2] = wrap(apart[:, 2])
    metres = np.concatenate([[0.0], np.cumsum(np.hypot(apart[:, 0], apart[:, 1]) + TURN_M * np.abs(apart[:, 2]))])
    corners = poses[0] + np.concatenate([np.zeros((1, 3)), np.cumsum(apart, axis=0)])
    at = np.linspace(0.0, metres[-1], int(np.ceil(metres[-1] / EVERY_M)) + 1)
    return np.column_stack([np.interp(at, metres, column) for column in corners.T]), at


def _arcs(config: DrivingConfig, narrow: bool) -> list[MotionCommand]:
    """Return the arcs among which one is chosen."""
    longest_m, robot = config.slow_m if narrow else config.robot.step_m, config.robot
    ways = [share for share in SHARES if share >= 0.0 or robot.can_reverse]
    return [MotionCommand(way * longest_m, turn * robot.turn_rad) for way in ways for turn in SHARES if way or turn]


def pilot_of(path: Path, planner: Planner, config: DrivingConfig) -> Pilot:
    """Return who drives along a path."""
    return (Pilot if path.headings_rad is None else PosePilot)(path, planner, config)
