"""The settings of second looks."""

from dataclasses import dataclass, field
from typing import Annotated

import numpy as np
from msgspec import Meta

from ...geometry.quantities import (
    Angle,
    Count,
    Deviation,
    Distance,
    Factor,
    Number,
    Share,
    Sigmas,
    Size,
    Spread,
    Weight,
)
from ...odometry.config import ScanMatchingConfig
from ..place_search import PlaceSearchConfig


@dataclass(frozen=True)
class ClosuresConfig:
    """Search for loop closures in the offline refinement."""

    every_m: Size = 0.5
    """Path length between two searches."""
    query_m: Size = 4.0
    """Length of the latest path whose scans are matched together; a second closure within it must agree before either
    is used."""
    beside_m: Distance = 5.0
    """Length of the old path, before and after an old scan, whose scans are matched against."""
    way_m: Distance = 6.0
    """Old scans closer than this along the path, over motions and closures, are not searched."""
    recent: Number = ScanMatchingConfig.keyframes
    """Number of latest scans that are not searched."""
    radius_m: Size = 1.0
    """Search radius around the believed position, before it grows with the path."""
    radius_share: Weight = 0.04
    """Growth of the search radius per metre of path since the old scan."""
    turn_rad: Angle = float(np.deg2rad(10.0))
    """Half-width of the heading search, before it grows with the path."""
    turn_a_metre: Angle = float(np.deg2rad(0.3))
    """Growth of the heading search per metre of path since the old scan."""
    most_rad: Angle = float(np.deg2rad(45.0))
    """Largest half-width of the heading search."""
    far_m: Distance = 6.0
    """Where the search radius would grow beyond this, the covariance of the pose graph takes its place."""
    far_sigmas: Sigmas = 3.0
    """Drift that is searched then, in standard deviations; a place beyond it is refused."""
    far_agree: Count = 3
    """Number of closures that must agree then before any is used."""
    slip_fit: Share = 0.4
    """If a smaller share of a scan's points lies near the scans before it, the robot has slipped and all headings are
    searched."""
    fit_scans: Count = 8
    """Number of previous scans that a scan is compared with to detect a slip."""
    places: Count = 3
    """Number of stretches of the old path that are searched, nearest first."""
    gap_m: Distance = ScanMatchingConfig.gap_m
    """Neighbouring returns closer together than this are connected to one surface."""
    place: PlaceSearchConfig = field(default_factory=PlaceSearchConfig)
    """Used for loop closures: the latest scans against older ones."""
    least_points: Number = 100
    """With fewer points no search is made."""
    sigma_m: Deviation = 0.05
    """Standard deviation of the position of a closure, along both axes."""
    sigma_rad: Spread = float(np.deg2rad(0.7))
    """Standard deviation of the heading of a closure."""
    slip_m: Deviation = 0.1
    """Standard deviation of a motion with slip, along both axes."""
    slip_rad: Spread = float(np.deg2rad(10.0))
    """Standard deviation of the turn of a motion with slip."""
    doubts: Annotated[tuple[Sigmas, ...], Meta(min_length=1)] = (1000.0, 30.0, 10.0, 3.0)
    """Scale of the Cauchy loss on closures, in standard deviations, one value for each round."""
    taken_back: Sigmas = 6.0
    """A closure whose final error is more standard deviations than this is removed."""

    @property
    def agree_m(self) -> float:
        """Two closures agree if both put the robot at the same place, to this: the last of `doubts` ..."""
        return self.doubts[-1] * self.sigma_m

    @property
    def agree_rad(self) -> float:
        """... and turned alike, to this."""
        return self.doubts[-1] * self.sigma_rad


@dataclass(frozen=True)
class SecondLooksConfig:
    """Offline refinement of a real robot's log: all segments are associated again and solved for together.

    On the paths of Intel the information of a motion is three to five times what scan matching states (`understated`),
    which leaves room for the filter to use the same scan again.
    """

    least_m: Distance = 0.4
    """Shortest segment that is used."""
    least_beams: Count = 6
    """Smallest number of beams of a segment that is used."""
    firm_rad: Angle = float(np.deg2rad(3.0))
    """Largest standard deviation of the direction of a segment that is used."""
    turn_rad: Angle = float(np.deg2rad(5.0))
    """Largest angle between a segment and its wall."""
    gates_m: Annotated[tuple[Distance, ...], Meta(min_length=1)] = (0.25, 0.15, 0.12, 0.12, 0.12)
    """Largest distance of a segment's ends from its wall, one value for each round of association."""
    overlap_m: Distance = 0.1
    """Smallest overlap of a segment and its wall."""
    least_sightings: Number = 3
    """Smallest number of observations of a wall."""
    floor_rad: Spread = float(np.deg2rad(0.5))
    """Standard deviation added to each observed direction in the solution, since no real wall is straight."""
    floor_m: Deviation = 0.02
    """Standard deviation added to each observed offset in the solution, since no real wall is straight."""
    understated: Factor = 4.0
    """Divisor of the covariance that scan matching states, since that is larger than the error."""
    doubt: Sigmas = 2.0
    """Scale of the Cauchy loss on observations and motions, in standard deviations."""
    iterations: Count = 6
    """Largest number of Gauss-Newton iterations in each round."""
    closures: ClosuresConfig = field(default_factory=ClosuresConfig)
