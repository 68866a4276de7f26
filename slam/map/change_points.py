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

from ..estimation.backend import Belief
from ..extraction.segments import Segments
from ..extraction.visible_extent import beam_step, beams_of
from ..geometry.lines import directions, normals
from ..geometry.poses import to_world
from ..robot import Scan
from .records import Merger, Records
from .vertices import LEAST_RAD

Sums = Float[np.ndarray, "2 p"]
"""At each place, information about by how much more the wall leads away beyond it, and that times so much."""


@dataclass(frozen=True)
class ChangePointsConfig:
    """When a wall is known to bend."""

    pitch_m: float = 0.25
    """Bends are looked for at places so far apart along a wall: half of it from the bend, a turn of a degree is off by
    2 mm."""
    sigmas: float = 6.0
    """The turn differs from zero by so many of its own: hundreds of walls, each at dozens of places, are asked
    thousands of times."""
    gate_sigmas: float = 4.0
    """Beams farther off the line belong to something else; so may the last one on either end."""
    least_beams: int = 4
    """A scan counts at a place where it has so many beams on either side."""


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

    def see(self, belief: Belief, scan: Scan, segments: Segments, pairs: Int[np.ndarray, "m 2"]) -> ChangePoint | None:
        """Add one scan, whose `pairs` are (segment, wall id); return the surest bend that it lies across, if any."""
        beams, of = beams_of(segments.beams[pairs[:, 0]], len(scan.bearings_rad))
        alpha, r = segments.lines[pairs[:, 0]].T
        off_normal = scan.bearings_rad[beams] - alpha[of]
        cos = np.cos(off_normal)
        across, sigma = scan.ranges_m[beams] * cos - r[of], scan.sigmas_m[beams] * cos
        ours = np.abs(across) < self._config.gate_sigmas * sigma
        number = np.arange(len(of))
        from_end = np.minimum(number - np.searchsorted(of, of), np.searchsorted(of, of, side="right") - 1 - number)
        ours &= from_end >= 1
        if not ours.any():
            return None
        # Where beams meet the line, not where they ended: at a flat angle noise in range is noise along the wall, too.
        foot = _along(belief, pairs[:, 1], to_world(r[:, None] * normals(alpha), belief.pose_world))
        along = foot[of] + r[of] * np.tan(off_normal)
        place, place_of = _places(along[ours], of[ours], len(pairs), self._config.pitch_m)
        if not len(place):
            return None
        at = self._config.pitch_m * place
        turns = _turns(along[ours], across[ours], sigma[ours], of[ours], at, place_of, self._config.least_beams)
        information, sums = self._add(pairs[:, 1], place, place_of, turns)
        turn = -sums / np.maximum(information, 1e-9)
        is_bend = np.abs(turn) > LEAST_RAD
        sure = turn**2 * information * is_bend * (turns[0] > 0.0)
        best = int(np.argmax(sure))
        if sure[best] <= self._config.sigmas**2:
            return None
        row = place_of[best]
        bearing = float(alpha[row] + np.arctan((at[best] - foot[row]) / r[row]))
        segment, wall = pairs[row].tolist()
        return ChangePoint(wall, segment, bearing, float(at[best]), float(turn[best]), float(information[best] ** -0.5))

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
        bend = np.mod(change_point.bearing_rad - scan.bearings_rad[0], 2.0 * np.pi) / beam_step(scan)
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
        begin, sums = turns[row] or (first, terms[:, :0])
        before, after = max(begin - first, 0), max(first + terms.shape[1] - begin - sums.shape[1], 0)
        if before or after:
            begin, sums = begin - before, np.pad(sums, ((0, 0), (before, after)))
            turns[row] = begin, sums
        now = sums[:, first - begin : first - begin + terms.shape[1]]
        now += terms
        return now

    def keep_apart(self, one: int, other: int) -> None:
        """Take note that two walls are the sides of a bend."""
        self._records.pairs["cut"].add((min(one, other), max(one, other)))

    def _merge(self, merger: Merger) -> None:
        """Add the sums of the dropped wall at the nearest places of the kept one: half a pitch off at most."""
        turns = self._records.columns["turns"]
        if turns[merger.drop] is not None:
            first, sums = turns[merger.drop]
            self._add_to(merger.keep, first + round(merger.shift_m / self._config.pitch_m), sums)


def _along(
    belief: Belief, walls: Int[np.ndarray, " m"], points_world: Float[np.ndarray, "m 2"]
) -> Float[np.ndarray, " m"]:
    """Return how far along walls, each from its anchor, points lie, m."""
    rows = belief.rows(walls)
    return np.vecdot(directions(belief.means[rows, 0]), points_world - belief.anchors[rows])


def _places(
    along: Float[np.ndarray, " k"], of: Int[np.ndarray, " k"], count: int, pitch_m: float
) -> tuple[Int[np.ndarray, " p"], Int[np.ndarray, " p"]]:
    """Return the places, in pitches, between the first and the last beam of each of so many walls, and whose they are.

    The beams are given wall by wall, in the order in which they meet it.
    """
    bounds = np.searchsorted(of, np.arange(count + 1))
    seen = np.flatnonzero(np.diff(bounds))
    first = np.floor(along[bounds[seen]] / pitch_m).astype(np.int64) + 1
    # A lone beam at a place itself would have one less than none.
    places = np.maximum(np.ceil(along[bounds[seen + 1] - 1] / pitch_m).astype(np.int64) - first, 0)
    begin = np.cumsum(places) - places
    return np.arange(places.sum()) + np.repeat(first - begin, places), np.repeat(seen, places)


def _turns(
    along: Float[np.ndarray, " k"],
    across: Float[np.ndarray, " k"],
    sigma: Float[np.ndarray, " k"],
    of: Int[np.ndarray, " k"],
    places: Float[np.ndarray, " p"],
    place_of: Int[np.ndarray, " p"],
    least_beams: int,
) -> Sums:
    """Return the sums of beams at `along`, off lines by `across`, m: by how much more per metre a wall leads away
    beyond each place, whatever its line; nothing where fewer than so many beams lie on either side.

    The model is across = a + b along + turn max(along - place, 0); a and b are eliminated. Beams, and places, are given
    wall by wall in ascending order, so that what lies beyond a place is a difference of running sums.
    """
    walls = np.arange(of[-1] + 1)
    bounds = np.searchsorted(of, np.append(walls, len(walls)))
    middle = np.zeros(len(walls))
    seen = np.diff(bounds) > 0
    middle[seen] = 0.5 * (along[bounds[:-1][seen]] + along[bounds[1:][seen] - 1])
    x, s, weight = along - middle[of], places - middle[place_of], 1.0 / np.square(sigma)
    running = np.zeros((5, len(x) + 1))
    np.cumsum(weight * np.stack([np.ones_like(x), x, x * x, across, x * across]), axis=1, out=running[:, 1:])
    end = bounds[place_of + 1]
    # Walls lie in order, and so do the beams along each: one search for all, with each wall far from the next.
    apart = 4.0 * (np.abs(x).max() + np.abs(s).max()) + 1.0
    beyond = np.searchsorted(x + apart * of, s + apart * place_of, side="right")
    w0, w1, w2, e0, e1 = running[:, end] - running[:, beyond]
    t0, t1, t2, f0, f1 = running[:, end] - running[:, bounds[place_of]]
    h0, h1, hh, he = w1 - s * w0, w2 - s * w1, w2 - 2.0 * s * w1 + s * s * w0, e1 - s * e0
    det = t0 * t2 - t1 * t1
    a, b = (t2 * h0 - t1 * h1) / det, (t0 * h1 - t1 * h0) / det
    enough = np.minimum(end - beyond, beyond - bounds[place_of]) >= least_beams
    return np.where(enough, np.stack([np.maximum(hh - a * h0 - b * h1, 0.0), he - a * f0 - b * f1]), 0.0)
