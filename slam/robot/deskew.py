"""De-skewing: a scan that was taken in motion, as it would be had all its beams been taken at its end."""

from collections.abc import Callable
from dataclasses import replace

import numpy as np
from jaxtyping import Float

from ..geometry.poses import inverse, wrap
from .messages import Odometry, Scan, without_near
from .timed import TimedScan

KNOTS = 9
"""Times during a scan at which the odometry is asked; between them the motion is even."""
AT_REST = 1e-5
"""A scanner that moves by less, m and rad, while it turns, stands still."""
NEAREST_STEPS = 1.5
"""A direction in which no beam was taken within so many beam steps is not known."""
ONE_FACE = 0.2
"""Neighbouring returns whose ranges differ by less than this share of the nearer are of one face."""


def de_skewed(scan: TimedScan, odometry: Callable[[float, float], Odometry]) -> Scan:
    """Return the scan as it would be had all beams been taken at its end, from where the robot was then.

    Each return is carried along with the motion from its own time to the end; a range between two of one face lies on
    the chord between them. Raises RobotError for what no scan is.
    """
    scan = replace(scan, ranges_m=without_near(scan.ranges_m, scan.range_min_m))
    taken = (scan.sigma_m, scan.range_max_m, scan.end_s, scan.sigma_share, scan.start_s)
    as_taken = Scan.ordered(scan.bearings_rad, scan.ranges_m, *taken)
    places = _places(scan, odometry)
    if np.abs(places).max() < AT_REST:
        return as_taken
    heading = scan.bearings_rad + places[:, 2]
    reach = np.where(np.isposinf(scan.ranges_m), scan.range_max_m, scan.ranges_m)
    points = places[:, :2] + reach[:, None] * np.stack([np.cos(heading), np.sin(heading)], axis=-1)
    known = ~np.isnan(scan.ranges_m)
    ranges = np.full(len(as_taken.bearings_rad), np.nan)
    if known.any():
        ranges = _seen_from_the_end(points[known], np.isposinf(scan.ranges_m[known]), as_taken)
    return Scan(as_taken.bearings_rad, ranges, *taken)


def _places(scan: TimedScan, odometry: Callable[[float, float], Odometry]) -> Float[np.ndarray, "k 3"]:
    """Return where the robot was when each beam was taken, in its frame at the end of the scan."""
    times = np.linspace(scan.start_s, scan.end_s, KNOTS)
    knots = np.array([inverse(odometry(float(t), scan.end_s).motion) for t in times[:-1]] + [np.zeros(3)])
    knots[:, 2] = np.unwrap(knots[:, 2])
    knots[:, 2] -= knots[-1, 2]
    beams = np.linspace(scan.start_s, scan.end_s, len(scan.bearings_rad))
    return np.column_stack([np.interp(beams, times, column) for column in knots.T])


def _seen_from_the_end(points: Float[np.ndarray, "n 2"], is_free: np.ndarray, beams: Scan) -> Float[np.ndarray, " k"]:
    """Return the range along each beam from the origin to points around it; NaN where none is near its direction."""
    bearing, reach = np.arctan2(points[:, 1], points[:, 0]), np.hypot(points[:, 0], points[:, 1])
    order = np.argsort(bearing)
    bearing, reach, points, is_free = bearing[order], reach[order], points[order], is_free[order]
    wanted = wrap(beams.bearings_rad)
    after = np.searchsorted(bearing, wanted) % len(bearing)
    before = after - 1
    off_before, off_after = np.abs(wrap(wanted - bearing[before])), np.abs(wrap(bearing[after] - wanted))
    nearest = np.where(off_before <= off_after, before, after)
    near = np.minimum(off_before, off_after) <= NEAREST_STEPS * beams.step_rad
    ranges = np.where(is_free[nearest], np.inf, reach[nearest])
    apart = np.abs(reach[after] - reach[before])
    one_face = apart < ONE_FACE * np.minimum(reach[before], reach[after])
    one_face &= ~is_free[before] & ~is_free[after] & (off_before + off_after <= 2 * NEAREST_STEPS * beams.step_rad)
    along = points[after] - points[before]
    u = np.stack([np.cos(wanted), np.sin(wanted)], axis=-1)
    cross = u[:, 0] * along[:, 1] - u[:, 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        chord = (points[before, 0] * along[:, 1] - points[before, 1] * along[:, 0]) / cross
    ranges = np.where(one_face & np.isfinite(chord) & (chord > 0.0), chord, ranges)
    beyond = np.isfinite(ranges) & (ranges >= beams.range_max_m)
    return np.where(near, np.where(beyond, np.inf, ranges), np.nan)
