"""Runs of beams whose returns the scanner loses, told from the scans alone.

A beam without a return has gone on to the maximum range, or its return was lost. It was lost where a surface stands
well within range, as the scan before and the scan after show: a sound scanner has no such beams, and who walks by
stands at one place in one scan only. Once a scanner was seen to lose runs of beams, a run that is no longer than the
longest of these tells nothing.
"""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Bool, Float, Int

from chainslam.slam.estimation.mounting import odometry_of_scanner
from chainslam.slam.geometry.poses import to_robot, to_world
from chainslam.slam.robot import Odometry, Scan, ScannerSpec

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
    """One scan, and the runs in it that may have been lost: those where the scan before it shows a surface."""

    scan: Scan
    runs: list[Int[np.ndarray, " _"]]


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
        runs = _runs_of(np.isposinf(scan.ranges_m), scan.is_full_turn)
        runs = [run for run in runs if len(run) >= RUN]
        self._learn(scan, runs)
        doubtful = [run for run in runs if len(run) <= self.longest]
        if not doubtful:
            return scan
        ranges = scan.ranges_m.copy()
        ranges[np.concatenate(doubtful)] = np.nan
        return replace(scan, ranges_m=ranges)

    def _learn(self, scan: Scan, runs: list[Int[np.ndarray, " _"]]) -> None:
        """Find the runs that the scan before has lost, and those that this one may have."""
        before, motion = self._before, self._motion.motion
        if before is not None and before.runs:
            due = _meets(before.scan, to_world(_points(scan), motion))
            self._lost.append(max((len(run) for run in before.runs if due[run].all()), default=0))
            if np.count_nonzero(self._lost) >= SCANS:
                self.longest = max(self.longest, *self._lost)
        elif before is not None:
            self._lost.append(0)
        if before is not None and runs:
            due = _meets(scan, to_robot(_points(before.scan), motion))
            runs = [run for run in runs if due[run].all()]
        self._before = _Seen(scan, runs if before is not None else [])


def _points(scan: Scan) -> Float[np.ndarray, "k 2"]:
    """Return where each beam ended within reach of a sure return, scanner's frame, m; NaN for the others."""
    ranges = np.where(scan.ranges_m < SHARE * scan.range_max_m, scan.ranges_m, np.nan)
    points = np.stack([ranges * np.cos(scan.bearings_rad), ranges * np.sin(scan.bearings_rad)], axis=-1)
    return np.vstack([points, points[:1]]) if scan.is_full_turn else points


def _meets(scan: Scan, points: Float[np.ndarray, "k 2"]) -> Bool[np.ndarray, " b"]:
    """Return which beams, and their neighbours, must meet a surface of points in their order, in the scan's frame."""
    first, last = points[:-1], points[1:]
    bearing = np.arctan2(first[:, 1], first[:, 0])
    turn = np.arctan2(first[:, 0] * last[:, 1] - first[:, 1] * last[:, 0], np.sum(first * last, axis=1))
    far_m = np.maximum(np.hypot(*first.T), np.hypot(*last.T))
    # Unknown points compare as False; a surface seen from behind has its beams in the other order.
    held = (np.hypot(*(last - first).T) < APART_M) & (turn > 0.0) & (far_m < SHARE * scan.range_max_m)
    beams = len(scan.ranges_m)
    begin = (bearing[held] - scan.bearings_rad[0]) % (2.0 * np.pi) / scan.step_rad
    low, high = np.ceil(begin).astype(int), np.floor(begin + turn[held] / scan.step_rad).astype(int) + 1
    turns = np.zeros(2 * max(beams, int(np.ceil(2.0 * np.pi / scan.step_rad))) + 2)
    np.add.at(turns, low, 1.0)
    np.add.at(turns, np.maximum(high, low), -1.0)
    met = np.cumsum(turns) > 0.5
    meets = met[:beams].copy()
    if scan.is_full_turn:
        meets |= met[beams : 2 * beams]
    beside = [np.roll(meets, k) for k in range(-MARGIN, MARGIN + 1)]
    return np.all(beside, axis=0)


def _runs_of(flags: Bool[np.ndarray, " k"], is_full_turn: bool) -> list[Int[np.ndarray, " _"]]:
    """Return the rows of each run of flags; over a full turn the last row is followed by the first."""
    if flags.all():
        return [np.arange(len(flags))]
    first = int(np.argmin(flags)) if is_full_turn else 0
    rows = np.roll(np.arange(len(flags)), -first)
    return [run for run in np.split(rows, np.flatnonzero(np.diff(flags[rows])) + 1) if flags[run[0]]]
