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
    """Where a place is sought that the robot has been to before, and what proves that it is the same; for all logs."""

    every_m: Size = 0.5
    """A search begins wherever the robot has gone so far since the last one."""
    query_m: Size = 4.0
    """The scans of so many last metres are laid onto others. A closure is believed with another one, sought no farther
    from it along the path and not right before it. They are laid onto ..."""
    beside_m: Distance = 5.0
    """... an old scan and those that were taken no farther from it along the path."""
    way_m: Distance = 6.0
    """Old scans that are nearer than this, by the way over motions and closures, need no closure."""
    recent: Number = ScanMatchingConfig.keyframes
    """So many last scans are not old: odometry was matched to them."""
    radius_m: Size = 1.0
    """A place is sought so far around where it is believed, and on old scans that were taken farther away by as much:
    they see the same walls, ..."""
    radius_share: Weight = 0.04
    """... and farther by this share of the way since, ..."""
    most_m: Distance = 6.0
    """... where that makes no more than this in all; ..."""
    turn_rad: Angle = float(np.deg2rad(10.0))
    """... and turned by so much, ..."""
    turn_a_metre: Angle = float(np.deg2rad(0.3))
    """... and more by so much for each metre of the way, ..."""
    most_rad: Angle = float(np.deg2rad(45.0))
    """... where that makes no more than this in all."""
    slip_fit: Share = 0.4
    """A scan of which a smaller share of points lies near those before it was taken after a slip: the turn between may
    have been any."""
    fit_scans: Count = 8
    """So many scans before it are looked at. A point lies near if it is within two cells of the search."""
    places: Count = 3
    """So many stretches of the old path are tried, the nearest first."""
    gap_m: Distance = ScanMatchingConfig.gap_m
    """Neighbouring returns that are nearer to each other are of one surface."""
    place: PlaceSearchConfig = field(default_factory=PlaceSearchConfig)
    """How a place is sought, and when it is believed."""
    least_points: Number = 100
    """With fewer points no place is sought."""
    sigma_m: Deviation = 0.05
    """Standard deviation of a closure, across both axes ..."""
    sigma_rad: Spread = float(np.deg2rad(0.7))
    """... and of its turn."""
    slip_m: Deviation = 0.1
    """Standard deviation of a motion in which the robot slipped, across both axes ..."""
    slip_rad: Spread = float(np.deg2rad(10.0))
    """... and of its turn."""
    doubts: Annotated[tuple[Sigmas, ...], Meta(min_length=1)] = (1000.0, 30.0, 10.0, 3.0)
    """Closures count less and less from so many standard deviations on, one round after the other: first all of them
    count, at last only those that agree with each other."""
    taken_back: Sigmas = 6.0
    """A closure that is off by more standard deviations than this in the end is taken back."""

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
    """How the segments of all scans are associated anew, and solved for together; the same for all logs."""

    least_m: Distance = 0.4
    """Shorter segments are left out ..."""
    least_beams: Count = 6
    """... and those of fewer beams ..."""
    firm_rad: Angle = float(np.deg2rad(3.0))
    """... or of a direction known less well."""
    turn_rad: Angle = float(np.deg2rad(5.0))
    """A segment is of a line whose direction differs by less ..."""
    gates_m: Annotated[tuple[Distance, ...], Meta(min_length=1)] = (0.25, 0.15, 0.12, 0.12, 0.12)
    """... from which neither of its ends is farther off than this, one for each round ..."""
    overlap_m: Distance = 0.1
    """... and which it overlaps by so much."""
    least_sightings: Number = 3
    """Lines seen more rarely say nothing."""
    floor_rad: Spread = float(np.deg2rad(0.5))
    """Real walls are not straighter than this ..."""
    floor_m: Deviation = 0.02
    """... nor smoother."""
    understated: Factor = 4.0
    """So many times as much as matching states is known of a motion: it says less, since a filter uses its scan again.
    By the paths of Intel it is three to five times as much."""
    doubt: Sigmas = 2.0
    """From so many standard deviations on an observation counts less and less (Cauchy's weight)."""
    iterations: Count = 6
    """Of Gauss and Newton's method in each round."""
    closures: ClosuresConfig = field(default_factory=ClosuresConfig)
    """Where the path comes back to a place."""
