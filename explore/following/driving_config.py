"""How the robot takes its steps: its numbers, and what follows from them for a robot's body."""

from dataclasses import dataclass

from chainslam.slam.geometry.quantities import Distance, Factor, Share, Size
from chainslam.slam.robot import RobotSpec, of_robot


@dataclass(frozen=True)
class DrivingConfig:
    """How the robot drives along a path, and how close to the returns of a scan it may come."""

    robot: RobotSpec = of_robot()
    horizon: Factor = 3.0
    """Whole steps are planned so many of the longest far."""
    clear_m: Distance = 0.008
    """Smallest distance between the body and any return; a short step may leave half, if no more was there."""
    clear_share: Share = 0.1
    """This share of the length of a step is kept in addition."""
    wide_m: Size = 0.05
    """Where the body has less room than this a step costs more, up to four times as much."""
    step_cost_m: Size = 0.05
    """What a step costs besides the way of the faster wheel."""
    back: Factor = 1.5
    """What a metre backwards costs, of one ahead."""
    rest: Factor = 2.0
    """The way beyond the horizon weighs so many times as much as that up to it: fewer poses are looked at."""
    better_m: Distance = 0.2
    """A plan is kept until another is cheaper by this; one that leads nowhere near the horizon has to save as much."""
    careful_m: Size = 0.05
    """Longest step onto floor that no scan has seen, and where there is less room than it asks for."""

    @property
    def radius_m(self) -> float:
        """The robot's disc; of an outline, the one around it: distances are told as from its middle (`reaches_m`)."""
        return self.robot.radius_m
