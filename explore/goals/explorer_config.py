"""The numbers of the top layer: when an end is given up, and when it is tried again."""

from __future__ import annotations

from dataclasses import dataclass, field

from chainslam.slam.geometry.circles import RoundConfig
from chainslam.slam.geometry.quantities import Count, Distance, Number, Share, Size, Wait
from chainslam.slam.robot import RobotSpec, of_robot

from ..following.wall_following import FollowingConfig
from .sweep import SweepConfig


@dataclass(frozen=True)
class ExplorerConfig:
    """When an open end is blacklisted (no longer a goal), and when it is tried again."""

    robot: RobotSpec = of_robot()
    following: FollowingConfig = field(default_factory=FollowingConfig)
    near_beyond_m: Distance = 0.1
    """Open ends, and places to be visited, that are closer together than the robot's radius plus this count as one
    place."""
    moved_m: Distance = 0.2
    """A blacklisted open end is tried again once its estimate has moved this far."""
    attempts: Count = 3
    """A place at which open ends were blacklisted this often is not tried again."""
    returns: Number = 8
    """An open end that has disappeared and come back this often while the robot explored it is blacklisted."""
    grown: Share = 0.1
    """An open end that could not be viewed is tried again once the known floor around it has grown by this share."""
    round_things: RoundConfig = field(default_factory=RoundConfig)
    """Open ends on these obstacles are blacklisted without being viewed."""
    patience_m: Size = 60.0
    """A goal that takes more steps than a path of this length is blacklisted."""
    wait_s: Wait = 10.0
    """Time after the last goal was given up before all of them are tried again, if something in the building moved."""
    again: Number = 3
    """How often in a run all goals are tried again because something moved."""
    moving_scans: Count = 3
    """Number of scans that must show a moving object before goals are tried again for that reason."""
    second_looks: Number = 4
    """Number of additional scans, each after a turn on the spot, taken before the run ends if there are tentative
    walls."""
    sweep: bool = True
    """After the last open end, visit reachable floor that no scan has seen and obstacles that are no wall of the
    map."""
    sweeping: SweepConfig = field(default_factory=SweepConfig)

    @property
    def near_m(self) -> float:
        """Ends, and places to be visited, this near to each other are one."""
        return self.robot.beyond(self.near_beyond_m)

    @property
    def patience_steps(self) -> int:
        """A goal that takes more steps is set aside."""
        return self.robot.steps_of(self.patience_m)
