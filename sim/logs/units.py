"""Plausibility of units: numbers that cannot be metres, radians or seconds are refused with the likely unit."""

from itertools import pairwise

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import wrap

from .raw_scan import LogError, RawScan

CLOCKS = {1e11: ("milliseconds", "1000"), 1e14: ("microseconds", "1e6"), 1e17: ("nanoseconds", "1e9")}
"""Larger clock values are not seconds: the likely units and their divisors."""
SLOW_S, SLOWEST_S = 10.0, 600.0
"""Longer times between scans are reported, and refused: a drive has a scan every second or so."""
LONG_RANGE_M, FEW = 20.0, 0.02
"""A scanner with this range gets more than this share of its beams back."""
RANGES_M = 0.03, 100.0
"""Upper limit of the median range."""
FASTEST_M_S, FASTEST_RAD_S, FARTHEST_M = 30.0, 6.0, 20.0
"""Upper limits of mean speeds while moving, and of the distance between scans if the clock stands still."""
ENOUGH = 3


class Measures:
    """Statistics of a log's scans, collected one by one."""

    def __init__(self) -> None:
        self._times: list[float] = []
        self._odom: list[np.ndarray] = []
        self._middles: list[float] = []
        self._returned, self._beams, self._reach_m = 0, 0, 0.0

    def see(self, scan: RawScan) -> None:
        """Add a scan."""
        returns = scan.ranges_m[np.isfinite(scan.ranges_m)]
        self._times.append(scan.time_s)
        if scan.robot_odom is not None:
            self._odom.append(scan.robot_odom)
        if len(returns):
            self._middles.append(float(np.median(returns)))
        self._returned += len(returns)
        self._beams += len(scan.ranges_m)
        self._reach_m = max(self._reach_m, scan.range_max_m)

    def check(self, notes: list[str]) -> None:
        """Raise LogError for an impossible unit; `notes` receives what is only unusual."""
        times = np.array(self._times)
        seconds = np.diff(times)
        self._check_clock(times, seconds, notes)
        self._check_ranges()
        if len(self._odom) == len(times) > ENOUGH:
            _check_motions(np.array([b - a for a, b in pairwise(self._odom)]), seconds)

    def _check_clock(self, times: Float[np.ndarray, " n"], seconds: Float[np.ndarray, " m"], notes: list[str]) -> None:
        latest = float(np.abs(times).max(initial=0.0))
        for least, (unit, divisor) in reversed(CLOCKS.items()):
            if latest >= least:
                raise LogError(f"expected times in seconds, found {latest:.0f}: {unit}? divide them by {divisor}")
        between = float(np.median(seconds)) if len(seconds) >= ENOUGH else 0.0
        if between > SLOWEST_S:
            raise LogError(f"expected times in seconds, found a scan every {between:g}: divide them by what they count")
        if between > SLOW_S:
            notes.append(
                f"expected a scan every second or so, found one every {between:g} s: are the times in seconds?"
            )
        equal = int(np.count_nonzero(seconds == 0.0))
        if equal:
            notes.append(
                f"expected increasing times, found {equal} of {len(times)} scans with the time of the one before"
            )

    def _check_ranges(self) -> None:
        share = self._returned / max(self._beams, 1)
        if not self._returned or (self._reach_m >= LONG_RANGE_M and share < FEW):
            raise LogError(
                f"expected ranges in metres, found {100.0 * share:.2g} % of all beams within {self._reach_m:g} m:"
                " millimetres? divide them by 1000"
            )
        middle, (least, most) = float(np.median(self._middles)), RANGES_M
        if not least <= middle <= most:
            raise LogError(
                f"expected ranges in metres, found {middle:g} for the middle one: another unit? convert them"
            )


def _check_motions(motions: Float[np.ndarray, "m 3"], seconds: Float[np.ndarray, " m"]) -> None:
    """Raise LogError for impossible motions between scans."""
    ways, turns = np.hypot(*motions[:, :2].T), np.abs(wrap(motions[:, 2]))
    moves, turning = ways > 1e-6, turns > 1e-3
    if np.count_nonzero(moves) >= ENOUGH:
        whole_s = float(seconds[moves].sum())
        speed = float(ways[moves].sum()) / whole_s if whole_s > 0.0 else 0.0
        if speed > FASTEST_M_S or (whole_s == 0.0 and float(np.median(ways[moves])) > FARTHEST_M):
            found = f"{speed:.0f} m/s" if whole_s else f"{float(np.median(ways[moves])):.0f} m from scan to scan"
            raise LogError(f"expected odometry in metres, found {found}: millimetres? divide it by 1000")
    if np.count_nonzero(turning) >= ENOUGH and (whole_s := float(seconds[turning].sum())) > 0.0:
        rate = float(turns[turning].sum()) / whole_s
        if rate > FASTEST_RAD_S:
            raise LogError(f"expected headings in radians, found {rate:.0f} rad/s: degrees? multiply them by pi/180")
