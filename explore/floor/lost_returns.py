"""Runs of beams whose returns the scanner loses, told from the scans alone.

A beam without a return has gone on to the maximum range, or its return was lost. It was lost where a surface stands
well within range, as the scan before and the scan after show: a sound scanner has no such beams, and who walks by
stands at one place in one scan only. Once a scanner was seen to lose runs of beams, a run that is no longer than the
longest of these tells nothing.
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.estimation.mounting import odometry_of_scanner
from chainslam.slam.geometry.poses import to_robot, to_world
from chainslam.slam.robot import Odometry, Scan, ScannerSpec

from .return_kernels import lengths_of_runs, must_meet

RUN = 3
"""Shorter runs without a return are never taken for free floor (`Scan.passed_m`)."""
SCANS, WITHIN = 3, 20
"""A scanner loses runs of returns if so many scans show one, of so many."""
SHARE, APART_M, MARGIN = 0.8, 0.3, 3
"""A surface that lies within this share of the maximum range and whose points are no farther apart returns a beam, if
it returns so many more on either side."""
NO_MOTION = Odometry(np.zeros(3), np.zeros((3, 3)))


@dataclass(frozen=True)
class _Seen:
    """One scan, and the lengths of the runs in it that may have been lost: those where one before shows a surface."""

    scan: Scan
    points: Float[np.ndarray, "k 2"]
    runs: Int[np.ndarray, " b"]


class LostReturns:
    """Keeps the last scan, and how long the runs are that the scanner loses."""

    def __init__(self, scanner: ScannerSpec) -> None:
        self.longest = 0
        """So many neighbouring beams were lost at most; 0 while the scanner is not known to lose any."""
        self._scanner, self._motion = scanner, NO_MOTION
        self._before: _Seen | None = None
        self._lost: deque[int] = deque(maxlen=WITHIN)

    def move(self, odometry: Odometry) -> None:
        """Take note of the motion since the last scan."""
        self._motion = odometry_of_scanner(odometry, self._scanner)

    def believed(self, scan: Scan) -> Scan:
        """Return a scan with NaN in place of the runs of +inf that may have been lost; itself where there are none."""
        none = np.isposinf(scan.ranges_m)
        runs = lengths_of_runs(none, none, scan.is_full_turn)
        runs[runs < RUN] = 0
        self._learn(scan, runs)
        doubtful = (runs > 0) & (runs <= self.longest)
        return replace(scan, ranges_m=np.where(doubtful, np.nan, scan.ranges_m)) if doubtful.any() else scan

    def _learn(self, scan: Scan, runs: Int[np.ndarray, " b"]) -> None:
        """Find the runs that the scan before has lost, and those that this one may have."""
        before, motion, points = self._before, self._motion.motion, _points(scan)
        if before is None:
            runs = np.zeros_like(runs)
        else:
            self._lost.append(int(_hiding(before.scan, before.runs, to_world(points, motion)).max()))
            if self._lost[-1] and sum(map(bool, self._lost)) >= SCANS:
                self.longest = max(self.longest, *self._lost)
            runs = _hiding(scan, runs, to_robot(before.points, motion))
        self._before = _Seen(scan, points, runs)


def _points(scan: Scan) -> Float[np.ndarray, "k 2"]:
    """Return where each beam ended within reach of a sure return, scanner's frame, m; NaN for the others."""
    ranges, beams = np.where(scan.ranges_m < SHARE * scan.range_max_m, scan.ranges_m, np.nan), len(scan.ranges_m)
    points = np.empty((beams + scan.is_full_turn, 2))
    points[:beams, 0], points[:beams, 1] = ranges * np.cos(scan.bearings_rad), ranges * np.sin(scan.bearings_rad)
    points[beams:] = points[:1]
    return points


def _hiding(scan: Scan, runs: Int[np.ndarray, " b"], points: Float[np.ndarray, "k 2"]) -> Int[np.ndarray, " b"]:
    """Return the lengths of those runs of a scan whose beams must all meet a surface of points in its frame."""
    if not runs.any():
        return runs
    first_rad, reach_m, beams = scan.bearings_rad[0], SHARE * scan.range_max_m, len(runs)
    due = must_meet(points, beams, first_rad, scan.step_rad, scan.is_full_turn, reach_m, APART_M, MARGIN)
    return lengths_of_runs(runs > 0, due, scan.is_full_turn)
