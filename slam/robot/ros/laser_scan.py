"""`sensor_msgs/LaserScan`, of ROS 1 or 2, by its fields alone."""

import math
from typing import Any

import numpy as np

from ..errors import RobotError
from ..timed import TimedScan
from .transforms import seconds

LEAST_RANGE_M = 1e-3
"""Nearer returns are none, whatever the scanner says of its minimum: 0 says that nothing came back."""
LONGEST_TURN = 1.5
"""Beams that would take longer than so many times the scan's own time have a wrong `time_increment`."""
COVERED = 0.05
"""A scanner is inside something where more than this share of its beams, and those opposite to them, are too near."""


def timed_scan(message: Any, upside_down: bool = False, sigma_m: float = 0.01, sigma_share: float = 0.0) -> TimedScan:
    """Return the scan of a LaserScan message, with beams in the order of time and in the frame of an upright scanner.

    Ranges at or beyond the maximum become +inf; those below the minimum, NaN, -inf and 0 become invalid, since drivers
    write 0 for returns that are too near, too weak or missing. Beams that a revolution reports twice are left out.
    Raises RobotError for a message that is no scan.
    """
    step, low = float(message.angle_increment), float(message.angle_min)
    ranges = np.asarray(message.ranges, dtype=np.float64)
    if len(ranges) < 2 or not step or not math.isfinite(step) or not math.isfinite(low):
        raise RobotError(f"expected beams, found {len(ranges)} of them {step:g} rad apart")
    most = float(message.range_max)
    if not 0.0 < most < math.inf:
        raise RobotError(f"expected the scanner's maximum range, found {most:g} m")
    ranges = ranges[: max(math.ceil(2.0 * np.pi / abs(step) - 0.5), 2)]
    bearings = (low + step * np.arange(len(ranges))) * (-1.0 if upside_down else 1.0)
    near = ~(ranges >= max(float(message.range_min), LEAST_RANGE_M))
    told = np.where(ranges >= most, np.inf, np.where(near, np.nan, ranges))
    start_s = seconds(message.header.stamp)
    end_s = start_s + beam_s(message) * (len(ranges) - 1)
    if end_s < start_s:  # the last beam was taken first
        bearings, told, start_s, end_s = bearings[::-1].copy(), told[::-1].copy(), end_s, start_s
    return TimedScan(bearings, told, sigma_m, most, start_s, end_s, sigma_share=sigma_share)


def beam_s(message: Any) -> float:
    """Return the time from one beam to the next; 0 where nobody tells or where it cannot be."""
    beam, turn = float(message.time_increment), float(getattr(message, "scan_time", 0.0))
    if not math.isfinite(beam) or (turn > 0.0 and abs(beam) * len(message.ranges) > LONGEST_TURN * turn):
        return 0.0
    return beam


def is_covered(message: Any) -> bool:
    """Return whether a scanner is inside something: it sees things nearer than it can measure on opposite sides.

    Beside a wall, however near, only one side is. Zeros do not count: many drivers write them where nothing came back.
    """
    ranges = np.asarray(message.ranges, dtype=np.float64)
    half = round(np.pi / abs(float(message.angle_increment))) if message.angle_increment else len(ranges)
    near = (ranges < float(message.range_min)) & (ranges != 0.0)
    opposite = near[: max(len(near) - half, 0)] & near[half:]
    return bool(2 * np.count_nonzero(opposite) > COVERED * len(ranges))
