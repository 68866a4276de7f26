"""The settings of second looks."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True)
class SecondLooksConfig:
    """How the segments of all scans are associated anew, and solved for together; the same for all logs."""

    least_m: float = 0.4
    """Shorter segments are left out ..."""
    least_beams: int = 6
    """... and those of fewer beams ..."""
    firm_rad: float = float(np.deg2rad(3.0))
    """... or of a direction known less well."""
    turn_rad: float = float(np.deg2rad(5.0))
    """A segment is of a line whose direction differs by less ..."""
    gates_m: tuple[float, ...] = (0.25, 0.15, 0.12, 0.12, 0.12)
    """... from which neither of its ends is farther off than this, one for each round ..."""
    overlap_m: float = 0.1
    """... and which it overlaps by so much."""
    least_sightings: int = 3
    """Lines seen more rarely say nothing."""
    floor_rad: float = float(np.deg2rad(0.5))
    """Real walls are not straighter than this ..."""
    floor_m: float = 0.02
    """... nor smoother."""
    odometry_m: float = 0.015
    """Standard deviation of the matched motion between two scans, across both axes ..."""
    odometry_rad: float = 0.004
    """... and of its turn."""
    doubt: float = 2.0
    """From so many standard deviations on an observation counts less and less (Cauchy's weight)."""
    iterations: int = 6
    """Of Gauss and Newton's method in each round."""
