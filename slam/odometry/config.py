"""The settings of scan matching."""

from dataclasses import dataclass

import numpy as np

from ..geometry.quantities import Angle, Count, Deviation, Distance, Part, Pitch, Share, Sigmas, Size, Spread, Turn


@dataclass(frozen=True)
class ScanMatchingConfig:
    """Scan matching against the latest keyframes."""

    keyframes: Count = 20
    """Number of latest keyframes to whose points a scan is matched."""
    reach_m: Size = 15.0
    """Returns farther away than this are not used."""
    cell_m: Size = 0.05
    """Cell size of the likelihood field; the scan is thinned to one point a cell."""
    gap_m: Distance = 0.3
    """Neighbouring returns closer together than this are connected to one surface."""
    kernel_m: Deviation = 0.06
    """Standard deviation of the likelihood field around each point."""
    gate_sigmas: Sigmas = 3.0
    """Half-width of the search window, in standard deviations of the wheel odometry."""
    step_rad: Turn = float(np.deg2rad(1.0))
    """Step between the headings that are tried."""
    slip_score: Share = 0.5
    """Mean likelihood below which a match is rejected and the search is widened, since the wheels have slipped."""
    slip_rad: Angle = float(np.deg2rad(54.0))
    """Half-width of the heading window in the widened search."""
    finest_m: Pitch = 0.005
    """Step at which the search ends; point-to-line matching refines the result."""
    sigma_m: Deviation = 0.03
    """Standard deviation of a point's distance from the surface of earlier points."""
    surface_m: Distance = 2.0
    """Largest distance between neighbouring points from which a surface normal is computed."""
    independent: Part = 0.1
    """Share of a scan's points that count as independent in the covariance of the match."""
    floor_m: Deviation = 0.005
    """Smallest standard deviation of the position of a match."""
    floor_rad: Spread = float(np.deg2rad(0.15))
    """Smallest standard deviation of the heading of a match."""
    least_points: Count = 20
    """With fewer points the scan is not matched, and the wheels give the motion."""
