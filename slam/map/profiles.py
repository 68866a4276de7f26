"""How far the faces of a wall lie from its line: what the beams of all scans say of a break, at places along the wall.

A line over two faces, which meet in a bend of half a degree or stand a step of 2 cm apart, fits any one scan. It is
wrong by the same in scan after scan, so that dozens of observations make the map sure of a line that neither face has.
Where the residuals of one scan's beams turn or step along the wall says nothing about the robot or the line: their
offset and slope, in which the errors of both are, are eliminated, and what the scans tell adds up.
"""

import math
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from ..estimation.backend import Belief
from ..estimation.shared import SharedConfig
from ..extraction.segments import Segments
from ..robot import Scan
from .kernels.profile_kernels import breaks_of_scan, keep_surest
from .records import Merger, Records

Sums = Float[np.ndarray, "5 p"]
"""At each place, information on a step and a turn, and information vector (`breaks_of_beams`)."""


class Profiles:
    """What all scans say of a break, for each wall at places along it, as far apart as ends are accurate.

    A break is believed if without one its likelihood ratio, a chi-square of two degrees of freedom, were as large by
    `SharedConfig.chance` only.
    """

    def __init__(self, shared: SharedConfig = SharedConfig(), records: Records | None = None) -> None:
        self._shared, self._pitch_m = shared, float(shared.resolution_m)
        self._least_ratio = -2.0 * math.log(shared.chance)
        self._records = Records() if records is None else records
        # The number of the first place and the sums from there on; the likeliest break: place m, step m and turn rad,
        # and from where to where beams fell, m.
        self._records.declare(self._merge, profile=None, broken=np.zeros(5))

    def see(self, belief: Belief, scan: Scan, segments: Segments, rows: Int[np.ndarray, " s"]) -> None:
        """Add one scan; `rows` holds the row of each segment's wall, -1 for none."""
        seen = segments.beams, segments.lines, segments.ends, rows, belief.pose_world, belief.anchors, belief.means
        beams = scan.bearings_rad, scan.ranges_m, np.ascontiguousarray(scan.sigmas_m)
        place, place_of, sums = breaks_of_scan(*seen, *beams, float(self._shared.noise_sigmas), self._pitch_m)
        bounds = [0, *((place_of[1:] != place_of[:-1]).nonzero()[0] + 1).tolist(), len(place)]
        for start, stop in pairwise(bounds if len(place) else ()):
            self._add(int(place_of[start]), int(place[start]), sums[:, start:stop])

    def _add(self, row: int, first: int, more: Sums) -> None:
        """Add to a wall's sums from its place `first` on."""
        columns = self._records.columns
        begin, sums = columns["profile"][row] or (first, more[:, :0])
        before, after = begin - first, first + more.shape[1] - begin - sums.shape[1]
        if before > 0 or after > 0:
            none = np.zeros((5, max(before, 0))), np.zeros((5, max(after, 0)))
            begin, sums = min(begin, first), np.concatenate([none[0], sums, none[1]], axis=1)
            columns["profile"][row] = begin, sums
        sums[:, first - begin : first - begin + more.shape[1]] += more
        keep_surest(sums, begin, self._pitch_m, self._least_ratio, columns["broken"][row])

    def _merge(self, merger: Merger) -> None:
        """Add the sums of the dropped wall at the nearest places of the kept one: half a pitch off at most."""
        theirs = self._records.columns["profile"][merger.drop]
        if theirs is not None:
            self._add(merger.keep, theirs[0] + round(merger.shift_m / self._pitch_m), theirs[1])
