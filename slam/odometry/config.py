"""The settings of scan matching."""

from dataclasses import dataclass

import numpy as np

from ..geometry.quantities import Angle, Count, Deviation, Distance, Part, Pitch, Share, Sigmas, Size, Spread, Turn


@dataclass(frozen=True)
class ScanMatchingConfig:
    """How a scan is laid onto the scans before it; the same for all robots and logs."""

    keyframes: Count = 20
    """A scan is matched to the points of so many scans before it."""
    reach_m: Size = 15.0
    """Returns from farther away are left out: there the beams are too far apart to tell walls."""
    cell_m: Size = 0.05
    """Size of a cell of the likelihood field; a scan's points are thinned to one for each."""
    gap_m: Distance = 0.3
    """Neighbouring returns that are nearer to each other are of one surface, which is likely between them too; else a
    scan would match the gaps between the beams of the one before."""
    kernel_m: Deviation = 0.06
    """How fast the likelihood falls with the distance from a point, as a standard deviation."""
    gate_sigmas: Sigmas = 3.0
    """The search goes so many standard deviations of the wheels to each side of where they say."""
    step_rad: Turn = float(np.deg2rad(1.0))
    """Between two turns that are tried; places are tried cell by cell."""
    slip_score: Share = 0.5
    """A match whose points score less on the mean is no match: the wheels have slipped, and the search goes wide."""
    slip_rad: Angle = float(np.deg2rad(54.0))
    """How far to each side the wide search turns."""
    finest_m: Pitch = 0.005
    """The search ends with steps of this size; the last of the way is drawn onto the surfaces."""
    sigma_m: Deviation = 0.03
    """Error of a point about the walls that the points before it tell."""
    surface_m: Distance = 2.0
    """A point tells where its surface is if its neighbours are nearer to each other than this."""
    independent: Part = 0.1
    """Share of a scan's points that count as independent: neighbours share the errors of walls that are not straight,
    and the same scans tell the map its lines."""
    floor_m: Deviation = 0.005
    """Standard deviation that no match is better than ..."""
    floor_rad: Spread = float(np.deg2rad(0.15))
    """... and of the turn."""
    least_points: Count = 20
    """With fewer points nothing is matched, and the wheels have the last word."""
