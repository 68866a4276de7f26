"""How far the faces of a wall lie from its line: what the beams of all scans say of a break, at places along the wall.

A line over two faces, which meet in a bend of half a degree or stand a step of 2 cm apart, fits any one scan. It is
wrong by the same in scan after scan, so that dozens of observations make the map sure of a line that neither face has.
Where the residuals of one scan's beams turn or step along the wall says nothing about the robot or the line: their
offset and slope, in which the errors of both are, are eliminated, and what the scans tell adds up.
"""

import math

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.backend import Belief
from ..estimation.shared import SharedConfig
from ..extraction.segments import Segments
from ..geometry.line_kernels import lines_from
from ..geometry.lines import directions
from ..robot import Scan
from .kernels.profile_kernels import beams_on_lines, breaks_of_beams, misfits, places_between, surest
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

    def see(self, belief: Belief, scan: Scan, segments: Segments, owners: Int[np.ndarray, " s"]) -> None:
        """Add one scan; `owners` holds the wall of each segment, -1 for none."""
        seen = np.flatnonzero(owners >= 0)
        walls, of = np.unique(owners[seen], return_inverse=True)
        rows = belief.rows(walls)
        lines, feet = lines_from(belief.pose_world, belief.anchors[rows], belief.means[rows])
        middles = segments.ends[seen].mean(axis=1)
        order = np.lexsort((np.vecdot(middles, directions(lines[of, 0])), of))
        seen, of = seen[order], of[order]
        beams = scan.bearings_rad, scan.ranges_m, np.ascontiguousarray(scan.sigmas_m)
        looks = segments.beams[seen], segments.lines[seen], of, lines, feet
        met = beams_on_lines(*looks, *beams, float(self._shared.noise_sigmas))
        place, place_of = places_between(met[0], met[3], self._pitch_m)
        sums = breaks_of_beams(*met, self._pitch_m * place, place_of)
        bounds = np.searchsorted(place_of, np.arange(len(walls) + 1)).tolist()
        for k, row in enumerate(self._records.rows(walls).tolist()):
            if bounds[k] < bounds[k + 1]:
                self._add(row, int(place[bounds[k]]), sums[:, bounds[k] : bounds[k + 1]])

    def _add(self, row: int, first: int, more: Sums) -> None:
        """Add to a wall's sums from its place `first` on."""
        columns = self._records.columns
        begin, sums = columns["profile"][row] or (first, more[:, :0])
        before, after = max(begin - first, 0), max(first + more.shape[1] - begin - sums.shape[1], 0)
        if before or after:
            begin, sums = begin - before, np.pad(sums, ((0, 0), (before, after)))
        sums[:, first - begin : first - begin + more.shape[1]] += more
        at, step_m, turn_rad, ratio = surest(sums, self._least_ratio)
        columns["profile"][row] = begin, sums
        columns["broken"][row] = 0.0
        if ratio > self._least_ratio:
            places = self._pitch_m * np.array([begin + at, begin, begin + sums.shape[1] - 1])
            columns["broken"][row] = places[0], step_m, turn_rad, places[1], places[2]

    def misfits(
        self, ids: Int[np.ndarray, " n"], extents: Float[np.ndarray, "n 2"]
    ) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 2"]]:
        """Return how far the faces of walls are off their lines, as variances across these, m^2, and over what.

        `extents` are from and to along each, m from its anchor. What beams have shown beyond them drew the line, too: a
        wall that ends at its bend now was seen past it before.
        """
        broken = self._records.columns["broken"][self._records.rows(ids)]
        low, high = np.minimum(extents[:, 0], broken[:, 3]), np.maximum(extents[:, 1], broken[:, 4])
        drawn = np.stack([low, high], axis=-1)
        return misfits(broken[:, :3].copy(), drawn), drawn

    def crooked(self, ids: Int[np.ndarray, " n"], extents: Float[np.ndarray, "n 2"]) -> Bool[np.ndarray, " n"]:
        """Return which walls have a break between their ends: they stand for two faces."""
        broken = self._records.columns["broken"][self._records.rows(ids)]
        is_broken = np.any(broken[:, 1:3] != 0.0, axis=-1)
        return is_broken & (extents[:, 0] < broken[:, 0]) & (broken[:, 0] < extents[:, 1])

    def _merge(self, merger: Merger) -> None:
        """Add the sums of the dropped wall at the nearest places of the kept one: half a pitch off at most."""
        theirs = self._records.columns["profile"][merger.drop]
        if theirs is not None:
            self._add(merger.keep, theirs[0] + round(merger.shift_m / self._pitch_m), theirs[1])
