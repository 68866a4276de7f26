"""The numbers of the top layer: when an end is given up, and when it is tried again."""

from dataclasses import dataclass, field

from chainslam.slam.geometry.circles import RoundConfig
from chainslam.slam.geometry.quantities import Count, Distance, Number, Size, Wait
from chainslam.slam.robot import RobotSpec, of_robot

from ..following.wall_following import FollowingConfig


@dataclass(frozen=True)
class ExplorerConfig:
    """When an open end is blacklisted (no longer a goal), and when it is tried again."""

    robot: RobotSpec = of_robot()
    following: FollowingConfig = field(default_factory=FollowingConfig)
    near_beyond_m: Distance = 0.1
    """Open ends, and places to be visited, that are closer together than the robot's radius plus this count as one
    place."""
    first_turns: Number = 4
    """Turns on the spot before the first goal."""
    round_things: RoundConfig = field(default_factory=RoundConfig)
    """Open ends on these obstacles are blacklisted without being viewed."""
    patience_m: Size = 60.0
    """A place is given up once its goals took more steps than a path of this length; a visit in vain takes half."""
    wait_s: Wait = 10.0
    """Time after the last goal was given up before all of them are tried again, if something in the building moved."""
    again: Number = 3
    """How often in a run all goals are tried again because something moved."""
    moving_scans: Count = 3
    """Number of scans that must show a moving object before goals are tried again for that reason."""
    sweep: bool = True
    """After the last open end, visit reachable floor that no scan has seen and obstacles that are no wall of the
    map."""

    @property
    def near_m(self) -> float:
        """Ends, and places to be visited, this near to each other are one."""
        return self.robot.beyond(self.near_beyond_m)

    @property
    def patience_steps(self) -> int:
        """A goal that takes more steps is set aside."""
        return self.robot.steps_of(self.patience_m)
