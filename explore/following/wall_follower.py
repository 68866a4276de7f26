"""The paper's wall following layer: approach a wall, follow it, drive round its ends, and turn back (section 3.1)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from chainslam.slam.geometry.poses import wrap
from chainslam.slam.map.chains import HEAD, TAIL
from chainslam.slam.robot import MotionCommand

from ..planning.lanes import lanes_of
from ..planning.paths import Planner
from .behaviour import Behaviour
from .driving import Controller
from .surroundings import Surroundings
from .track import Track, track_of
from .wall_following import FollowingConfig, PlaceErrand

AIM_M, FACING_RAD = 0.3, float(np.deg2rad(30.0))
"""The robot has turned round once it faces the place of the track so far ahead to within this."""
ON_TRACK = 0.3
"""An approach ends within this share of the stand-off of the track; following goes on up to twice the stand-off."""
PROGRESS_M, PATIENCE_STEPS = 0.1, 30
"""A motion is no longer possible, too, where so many steps led no farther along the track than this: a turn on the
spot takes up to 18 of them."""
IN_VAIN = 4
"""No motion is possible either way where the robot turned back so often and came no farther: each way is tried twice,
since right after a turn the noise of one scan may leave no safe step."""


class WallFollower:
    """Follows one wall to and fro until another is given; it ends only where no motion leads along it either way.

    The wall is followed at the stand-off, which yields where the body would not fit otherwise; round an end the robot
    goes on until no motion free of collision is left. Then it changes the driving direction (paper, section 3.1).
    """

    def __init__(self, wall: int, side: int | None, config: FollowingConfig) -> None:
        """Follow `wall`, towards `side` (`TAIL` or `HEAD`) first; without a side, towards the nearer end."""
        self.wall = wall
        self._side, self._config = side, config
        self._controller = Controller(config.driving)
        self._approach: PlaceErrand | None = None
        self._is_on_track, self._is_turning = False, False
        self._farthest_m, self._since, self._failed = -np.inf, 0, False
        self._turns, self._in_vain = 0, 0
        self.behaviour = Behaviour.APPROACH
        self.trouble = ""

    @property
    def ping_pongs(self) -> int:
        """How often the robot went to and fro: it turned back at both ends."""
        return self._turns // 2

    @property
    def doing(self) -> str:
        """What the robot does, in words."""
        end = ("tail", "head")[self._side or TAIL]
        return {
            Behaviour.APPROACH: f"approaches wall {self.wall}",
            Behaviour.FOLLOW: f"follows wall {self.wall} towards its {end}",
            Behaviour.ROUND: f"drives round the {end} of wall {self.wall}",
            Behaviour.REVERSE: f"turns back along wall {self.wall}",
        }[self.behaviour]

    def command(self, around: Surroundings) -> MotionCommand | None:
        """Return the next step; None where the wall is not in the map or no way leads to or along it (`trouble`)."""
        if self.wall not in around.walls.ids:
            self.trouble = f"wall {self.wall} is no longer in the map"
            return None
        track = track_of(self.wall, around.walls, self._config.viewpoints.standoff_m)
        position_m, distance_m = (float(each) for each in track.locate(around.pose_world[:2]))
        if self._side is None:
            self._side = TAIL if position_m < 0.5 * track.length_m else HEAD
        if not self._on_track(track, position_m, distance_m):
            command = self._come_near(around)
            if command is not None or self._approach is not None:
                return command
        return self._follow(track, position_m, around)

    def interrupt(self, around: Surroundings) -> None:
        """Turn back: something stands in the way that no return shows."""
        if self._approach is not None:
            self._approach.interrupt(around)
        elif self._is_on_track:
            self._reverse()

    def _on_track(self, track: Track, position_m: float, distance_m: float) -> bool:
        """Return whether the robot is beside the wall, on its free side or round an end."""
        slack_m = 1.0 if self._is_on_track else ON_TRACK
        turn_m = np.pi * track.standoff_m
        is_beside = -turn_m <= position_m <= track.length_m + turn_m or self._is_on_track
        self._is_on_track = bool(is_beside and abs(distance_m - track.standoff_m) <= slack_m * track.standoff_m)
        if self._is_on_track:
            self._approach = None
        return self._is_on_track

    def _come_near(self, around: Surroundings) -> MotionCommand | None:
        """Return the next step to the nearest place of the track; None, without an approach, once it is there."""
        self.behaviour = Behaviour.APPROACH
        if self._approach is None:
            over_floor = replace(self._config, navigation="floor")
            planner = Planner(around.free_space, around.pose_world[:2], self._config.paths)
            lanes = lanes_of(self.wall, around.walls, planner, self._config.viewpoints.standoff_m)
            stops = np.concatenate([np.zeros((0, 2)), *(lane.stops_world for lane in lanes)])
            self._approach = PlaceErrand(stops, self.doing, over_floor)
        command = self._approach.command(around)
        if command is None:
            self.trouble = self._approach.trouble
            if not self.trouble:  # as near to the track as the floor allows
                self._approach, self._is_on_track = None, True
        return command

    def _follow(self, track: Track, position_m: float, around: Surroundings) -> MotionCommand | None:
        """Return the next step along the track; where none is safe in two scans in a row, the robot turns back."""
        if self._in_vain == IN_VAIN:
            self.trouble = f"no motion along wall {self.wall} in either direction"
            return None
        ahead_m = position_m if self._side == HEAD else -position_m
        if ahead_m > self._farthest_m + PROGRESS_M:
            self._in_vain = 0 if np.isfinite(self._farthest_m) else self._in_vain
            self._farthest_m, self._since = ahead_m, 0
        self._since += 1
        command = self._along(track, position_m, around) if self._since <= PATIENCE_STEPS else None
        if command is not None:
            self._failed = False
            return command
        if not self._failed:  # in a tight place the noise of one scan may leave no safe step
            self._failed = True
            return MotionCommand(0.0, 0.0)
        self._reverse()
        return self._along(track, position_m, around) or MotionCommand(0.0, 0.0)

    def _along(self, track: Track, position_m: float, around: Surroundings) -> MotionCommand | None:
        """Return a safe step along the track, as near to the stand-off as there is one; None where there is none."""
        onward, pose = 1.0 if self._side == HEAD else -1.0, around.pose_world
        command = self._controller.command(around, track.field(pose, onward))
        if command is not None:
            aim = track.place(position_m + onward * AIM_M, track.standoff_m) - pose[:2]
            turn_rad = abs(float(wrap(np.arctan2(aim[1], aim[0]) - pose[2])))
            self._is_turning = self._is_turning and turn_rad > FACING_RAD
            self.behaviour = self._word(track, position_m)
        return command

    def _word(self, track: Track, position_m: float) -> Behaviour:
        if self._is_turning:
            return Behaviour.REVERSE
        return Behaviour.ROUND if track.is_past_end(position_m) else Behaviour.FOLLOW

    def _reverse(self) -> None:
        self._side = TAIL + HEAD - (HEAD if self._side is None else self._side)
        self._turns, self._in_vain = self._turns + 1, self._in_vain + 1
        self._is_turning, self._failed = True, False
        self._farthest_m, self._since = -np.inf, 0
        self._controller = Controller(self._config.driving)
        self.behaviour = Behaviour.REVERSE
