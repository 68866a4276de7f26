"""How the robot takes one step: its numbers, and what follows from them for a robot's body."""

from dataclasses import dataclass

import numpy as np

from chainslam.slam.geometry.quantities import Angle, Distance, Number, Size
from chainslam.slam.robot import RobotSpec, of_robot


@dataclass(frozen=True)
class DrivingConfig:
    """How fast one step goes, and how near to a return it may bring the disc."""

    robot: RobotSpec = of_robot()
    spin_rad: Angle = float(np.deg2rad(30.0))
    """With more than this to turn, the robot turns on the spot first."""
    lookahead_m: Size = 0.6
    """How far ahead on its path the robot aims; half as far, and half again, where no step towards that is safe ..."""
    least_lookahead_m: Size = 0.15
    """... but no less than this, ..."""
    short_points: Number = 8
    """... for so many points of the path, 0.05 m apart."""
    margin_m: Distance = 0.02
    """Least distance kept between disc and returns, unless the step leads away from them."""
    careful_m: Size = 0.05
    """Longest step onto floor that was not seen yet."""
    narrow_beyond_m: Distance = 0.15
    """Where returns on both sides of the way leave less than this beside the body, the robot aims for the middle,
    slowly ..."""
    narrow_margin_m: Distance = 0.01
    """... keeps at least this from them, ..."""
    narrow_spin_rad: Angle = float(np.deg2rad(4.0))
    """... turns on the spot first with more than this to turn, ..."""
    give_m: Distance = 0.003
    """Where less than that is left between two sides already, a step may take this much of it, ..."""
    least_margin_m: Distance = 0.004
    """... down to this. Beside a lone return there is room: that much is below a range's noise."""
    fits_beyond_m: Distance = 0.025
    """... and does not try where they leave less than this beside the body: returns tell the width to a centimetre.
    Where it stands between the two, it does fit: """
    within_m: Distance = 0.05
    """the line from one to the other passes so near to the robot's middle."""
    beside_m: Distance = 0.1
    """Beside the way are returns from this far behind the robot to this far beyond its aim."""
    obstructed_within_m: Distance = 0.03
    """A return nearer to the path ahead than the radius less this is in the way, since the path keeps to a grid."""
    arrived_m: Distance = 0.08
    """The end of the path counts as reached within this."""

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
