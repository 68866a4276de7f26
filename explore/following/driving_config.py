"""How the robot takes one step: its numbers, and what follows from them for a robot's body."""

from dataclasses import dataclass

import numpy as np

from chainslam.slam.geometry.quantities import Angle, Distance, Number, Size
from chainslam.slam.robot import RobotSpec, of_robot


@dataclass(frozen=True)
class DrivingConfig:
    """How the robot drives along a path, and how close to the returns of a scan it may come."""

    robot: RobotSpec = of_robot()
    spin_rad: Angle = float(np.deg2rad(30.0))
    """The robot turns on the spot first if its aim is more than this to one side."""
    lookahead_m: Size = 0.6
    """Distance ahead on the path at which the robot aims; it is halved while no safe step leads there."""
    least_lookahead_m: Size = 0.15
    """Lookahead at which `lookahead_m` is no longer halved."""
    short_points: Number = 8
    """Number of path points, 0.05 m apart, over which a shortened lookahead stays in use."""
    margin_m: Distance = 0.02
    """Smallest distance kept between the body and any return, unless the step leads away from it."""
    careful_m: Size = 0.05
    """Longest step onto floor that no scan has seen, and through narrow gaps."""
    narrow_beyond_m: Distance = 0.15
    """A gap is narrow if it is wider than the body by less than this; there the robot aims for the middle and drives
    slowly."""
    narrow_margin_m: Distance = 0.01
    """Smallest distance kept from any return in a narrow gap."""
    narrow_spin_rad: Angle = float(np.deg2rad(4.0))
    """In a narrow gap the robot turns on the spot first if its aim is more than this to one side."""
    give_m: Distance = 0.003
    """In a narrow gap, how much closer to a return one step may lead if less than `narrow_margin_m` is left."""
    least_margin_m: Distance = 0.004
    """Smallest distance kept from any return in a narrow gap, whatever `give_m` allows."""
    fits_beyond_m: Distance = 0.025
    """A gap that is wider than the body by less than this is not entered."""
    within_m: Distance = 0.05
    """The robot counts as inside a gap, and drives on, if its middle is this close to the line between the gap's
    sides."""
    beside_m: Distance = 0.1
    """Returns from this far behind the robot to this far beyond its aim count as the sides of a gap."""
    obstructed_within_m: Distance = 0.03
    """A return that reaches into the body's path by more than this is an obstacle, and another path is planned."""
    arrived_m: Distance = 0.08
    """The end of a path counts as reached within this distance."""

    @property
    def radius_m(self) -> float:
        """The robot's disc; of an outline, the one around it: distances are told as from its middle (`reaches_m`)."""
        return self.robot.radius_m

    @property
    def narrow_m(self) -> float:
        """A gap between returns of less than this is narrow."""
        return self.robot.beside(self.robot.half_width_m + self.narrow_beyond_m)

    @property
    def fits_m(self) -> float:
        """The body does not fit through a gap of less."""
        return self.robot.beside(self.robot.half_width_m + self.fits_beyond_m)

    @property
    def obstructed_m(self) -> float:
        """A return this near to the path ahead is in the way."""
        return self.robot.beyond(-self.obstructed_within_m)

    @property
    def slow_m(self) -> float:
        """Longest careful step: no longer than any."""
        return min(self.careful_m, self.robot.step_m)
