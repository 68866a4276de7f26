"""Bends that neither a scan nor the map shows: what the beams of many scans together say about how straight a wall is.

A line over both sides of a bend of half a degree fits any one scan. It is wrong by tenths of a degree, and by the same
tenths in the next scan, so that dozens of observations make the map sure of a direction that neither side has, and turn
the robot by it. Where the residuals of a fit turn along the wall says nothing about the robot's heading: each scan
tells the turn at a place to a degree, and what the scans tell adds up.
"""

from collections.abc import Set
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ...estimation.shared import SharedConfig, of_shared
from ...extraction.segments import Segments
from ...geometry.quantities import Count, Sigmas, Size
from ...robot import Scan
from ..records import Merger, Records
from .kernels.change_point_kernels import places_between, surest, turns_of_beams
from .vertices import LEAST_RAD
from .wall_beams import WallBeams, with_more

Sums = Float[np.ndarray, "2 p"]
"""At each place, information about by how much more the wall leads away beyond it, and that times so much."""


@dataclass(frozen=True)
class ChangePointsConfig:
    """When a wall is split at a breakpoint that only many scans together show.

    Beams that deviate from the line by more than noise belong to something else, and so may the last one at either end.
    The significance is high because hundreds of walls are tested at dozens of places, thousands of times.
    """

    shared: SharedConfig = of_shared()
    pitch_m: Size = 0.25
    """Distance between the places along a wall at which a breakpoint is tested."""
    sigmas: Sigmas = 6.0
    """Significance of the angle, in standard deviations, from which a breakpoint is accepted."""
    least_beams: Count = 4
    """Number of beams that a scan must have on either side of a place to count there."""


@dataclass(frozen=True)
class ChangePoint:
    """Where a wall bends."""

    wall: int
    """Its id."""
    segment: int
    """The segment of the present scan that lies across the bend."""
    bearing_rad: float
    """Of the bend, robot frame."""
    along_m: float
    """Of the bend, along the wall from its anchor."""
    turn_rad: float
    """Of the normal, walking along the wall with the free side on the left."""
    sigma_rad: float
    """Of the turn."""

    @property
    def sigmas(self) -> float:
        """How surely there is a bend."""
        return abs(self.turn_rad) / self.sigma_rad


class ChangePoints:
    """What the observations of each wall say of a turn, at places along it."""

    def __init__(self, config: ChangePointsConfig = ChangePointsConfig(), records: Records | None = None) -> None:
        self._config = config
        self._records = Records() if records is None else records
        self._records.declare(self._merge, turns=None)
        self._records.relate("cut")

    @property
    def cut(self) -> Set[tuple[int, int]]:
        """Pairs of ids, the lower first, made of one bent wall: they are two, whatever their lines look like."""
        return {(min(pair), max(pair)) for pair in self._records.pairs["cut"]}

    def see(self, seen: WallBeams) -> ChangePoint | None:
        """Add one scan; return the surest bend that it lies across, if any."""
        config = self._config
        place, place_of = places_between(seen.along, seen.of, float(config.pitch_m))
        if not len(place):
            return None
        at = config.pitch_m * place
        turns = turns_of_beams(seen.along, seen.across, seen.sigma, seen.of, at, place_of, config.least_beams)
        information, sums = self._add(seen.walls, place, place_of, turns)
        best, turn, square = surest(information, sums, turns[0], LEAST_RAD)
        if square <= config.sigmas**2:
            return None
        row = place_of[best]
        alpha, r = seen.lines[row].tolist()
        bearing = float(alpha + np.arctan((at[best] - seen.feet[row]) / r))
        wall, segment = int(seen.walls[row]), int(seen.segments[row])
        return ChangePoint(wall, segment, bearing, float(at[best]), turn, float(information[best] ** -0.5))

    def sides_of(
        self, change_point: ChangePoint, segments: Segments, pieces: Segments, scan: Scan
    ) -> tuple[int, int] | None:
        """Return the neighbours among `pieces`, of the same scan cut at a bend, between which it lies.

        None where there are no two.
        """
        beams, margin = len(scan.bearings_rad), 2
        first, last = segments.beams[change_point.segment] + [
            -margin,
            margin,
        ]  # a beam in doubt may have been left to either
        run = np.mod(pieces.beams - first, beams)
        ours = np.flatnonzero((run[:, 0] <= run[:, 1]) & (run[:, 1] <= np.mod(last - first, beams)))
        if len(ours) < 2:
            return None
        ours = ours[np.argsort(run[ours, 0])]
        bend = np.mod(change_point.bearing_rad - scan.bearings_rad[0], 2.0 * np.pi) / scan.step_rad
        bend = np.mod(bend - first, beams)
        nearest = int(np.argmin(np.abs(0.5 * (run[ours[:-1], 1] + run[ours[1:], 0]) - bend)))
        before, after = ours[nearest : nearest + 2].tolist()
        return before, after

    def _add(
        self, walls: Int[np.ndarray, " m"], place: Int[np.ndarray, " p"], place_of: Int[np.ndarray, " p"], terms: Sums
    ) -> Sums:
        """Add to the sums of walls at some places, which are given wall by wall; return what they are there now."""
        bounds = np.searchsorted(place_of, np.arange(len(walls) + 1))
        now = np.empty_like(terms)
        rows = self._records.rows(walls)
        for row, start, stop in zip(rows.tolist(), bounds[:-1].tolist(), bounds[1:].tolist(), strict=True):
            if start < stop:
                now[:, start:stop] = self._add_to(row, int(place[start]), terms[:, start:stop])
        return now

    def _add_to(self, row: int, first: int, terms: Sums) -> Sums:
        """Add to a wall's sums from its place `first` on; return what they are there now."""
        turns = self._records.columns["turns"]
        begin, sums = turns[row] = with_more(turns[row], first, terms)
        return sums[:, first - begin : first - begin + terms.shape[1]]

    def keep_apart(self, one: int, other: int) -> None:
        """Take note that two walls are the sides of a bend."""
        self._records.pairs["cut"].add((min(one, other), max(one, other)))

    def _merge(self, merger: Merger) -> None:
        """Add the sums of the dropped wall at the nearest places of the kept one: half a pitch off at most."""
        turns = self._records.columns["turns"]
        if turns[merger.drop] is not None:
            first, sums = turns[merger.drop]
            self._add_to(merger.keep, first + round(merger.shift_m / self._config.pitch_m), sums)
