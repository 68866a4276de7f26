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
    """When an end is given up, and for how long."""

    robot: RobotSpec = of_robot()
    following: FollowingConfig = field(default_factory=FollowingConfig)
    near_beyond_m: Distance = 0.1
    """Ends, and places to be visited, no farther apart than the radius and this, the errors of a map, are one."""
    moved_m: Distance = 0.2
    """An end that was set aside is tried again when it has moved this far."""
    attempts: Count = 3
    """So many ends set aside at one place (as above) are enough: it is not tried again."""
    returns: Number = 8
    """An end that was gone so often while the robot was about it, and came back, is set aside."""
    grown: Share = 0.1
    """An end that could not be looked at is tried again when so much more of the floor around it is known."""
    round_things: RoundConfig = field(default_factory=RoundConfig)
    """Ends on these are set aside without a look of their own."""
    patience_m: Size = 60.0
    """A goal that takes more steps than so long a way is set aside."""
    wait_s: Wait = 10.0
    """Where something moved, what was given up is tried again so long after the last of it was, ..."""
    again: Number = 3
    """... at most so often in a run, ..."""
    moving_scans: Count = 3
    """... and something moved if so many scans show it."""
    second_looks: Number = 4
    """Before it ends, the robot turns on the spot this often while there are tentative walls."""
    sweep: bool = True
    """After the last chain, visit what is reachable and unseen."""
    sweeping: SweepConfig = field(default_factory=SweepConfig)

    @property
    def near_m(self) -> float:
        """Ends, and places to be visited, this near to each other are one."""
        return self.robot.beyond(self.near_beyond_m)

    @property
    def patience_steps(self) -> int:
        """A goal that takes more steps is set aside."""
        return self.robot.steps_of(self.patience_m)
