"""Bends that neither a scan nor the map shows: what the beams of many scans together say about how straight a wall is.

A line over both sides of a bend of half a degree fits any one scan. It is wrong by tenths of a degree, and by the same
tenths in the next scan, so that dozens of sightings make the map sure of a direction that neither side has, and turn
the robot by it. Where the residuals of a fit turn along the wall says nothing about the robot's heading: each scan
tells the turn at a place to a degree, and what the scans tell adds up.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from .backend import Belief
from .geometry.lines import directions, normals
from .geometry.poses import to_world
from .pieces import beams_of
from .robot import Scan
from .segments import Segments

Sums = Float[np.ndarray, "2 p"]
"""At each place, information about by how much more the wall leads away beyond it, and that times so much."""


@dataclass(frozen=True)
class KinksConfig:
    """When a wall is known to bend."""

    pitch_m: float = 0.25
    """Bends are looked for at places so far apart along a wall: half of it from the bend, a turn of a degree is off by
    2 mm."""
    sigmas: float = 6.0
    """The turn differs from zero by so many of its own: hundreds of walls, each at dozens of places, are asked
    thousands of times."""
    least_rad: float = float(np.deg2rad(0.2))
    """Smaller turns are none: over thousands of beams every real wall shows one."""
    gate_sigmas: float = 4.0
    """Beams farther off the line belong to something else."""
    least_beams: int = 6
    """Fewer beams have nothing to say beside the line itself."""


@dataclass(frozen=True)
class Kink:
    """Where a wall bends."""

    wall: int
    """Its id."""
    segment: int
    """The segment of the present scan that lies across the bend."""
    bearing_rad: float
    """Of the bend, robot frame."""
    turn_rad: float
    """Of the normal, walking along the wall with the free side on the left."""
    sigma_rad: float
    """Of the turn."""

    @property
    def sigmas(self) -> float:
        """How surely there is a bend."""
        return abs(self.turn_rad) / self.sigma_rad


class Kinks:
    """What the sightings of each wall say of a turn, at places along it; ids are those of the map and only grow."""

    def __init__(self, config: KinksConfig = KinksConfig()) -> None:
        self._config = config
        self._sums: dict[int, tuple[int, Sums]] = {}
        self._cut: set[tuple[int, int]] = set()

    @property
    def cut(self) -> frozenset[tuple[int, int]]:
        """Pairs of ids, the lower first, made of one bent wall: they are two, whatever their lines look like."""
        return frozenset(self._cut)

    def see(self, belief: Belief, scan: Scan, segments: Segments, pairs: Int[np.ndarray, "m 2"]) -> Kink | None:
        """Add one scan, whose `pairs` are (segment, wall id); return the surest bend that it lies across, if any."""
        seen = [self._see(belief, scan, segments, *pair) for pair in pairs.tolist()]
        return max((kink for kink in seen if kink is not None), key=lambda kink: kink.sigmas, default=None)

    def _see(self, belief: Belief, scan: Scan, segments: Segments, segment: int, wall: int) -> Kink | None:
        alpha, r = segments.lines[segment]
        at = beams_of(segments.beams[segment], len(scan.bearings_rad))
        off_normal = scan.bearings_rad[at] - alpha
        across = scan.ranges_m[at] * np.cos(off_normal) - r
        sigma = scan.sigma_m * np.cos(off_normal)
        ours = np.abs(across) < self._config.gate_sigmas * sigma
        if np.count_nonzero(ours) < self._config.least_beams:
            return None
        # Where beams meet the line, not where they ended: at a flat angle noise in range is noise along the wall, too.
        along = r * np.tan(off_normal[ours])
        shift = self._shift(belief, wall, r * normals(alpha))
        pitch = self._config.pitch_m
        first, last = np.floor((along.min() + shift) / pitch) + 1, np.ceil((along.max() + shift) / pitch)
        places = np.arange(int(first), int(last))
        if not len(places):
            return None
        terms = _turns(along, across[ours], sigma[ours], pitch * places - shift)
        information, sums = self._add(wall, int(first), terms)
        turn = -sums / np.maximum(information, 1e-9)
        sure = turn**2 * information * (np.abs(turn) > self._config.least_rad)
        best = int(np.argmax(sure))
        if sure[best] <= self._config.sigmas**2:
            return None
        bearing = float(alpha + np.arctan((pitch * places[best] - shift) / r))
        return Kink(wall, segment, bearing, float(turn[best]), float(information[best] ** -0.5))

    @staticmethod
    def _shift(belief: Belief, wall: int, foot_robot: Float[np.ndarray, "2"]) -> float:
        """Return how far along a wall, from its anchor, the foot of the robot's perpendicular lies, m."""
        row = belief.rows([wall])[0]
        foot_world = to_world(foot_robot[None], belief.pose_world)[0]
        return float(directions(belief.means[row, 0]) @ (foot_world - belief.anchors[row]))

    def _add(self, wall: int, first: int, terms: Sums) -> Sums:
        """Add to a wall's sums from its place `first` on; return what they are there now."""
        begin, sums = self._sums.get(wall, (first, terms[:, :0]))
        before, after = max(begin - first, 0), max(first + terms.shape[1] - begin - sums.shape[1], 0)
        begin, sums = begin - before, np.pad(sums, ((0, 0), (before, after)))
        now = sums[:, first - begin : first - begin + terms.shape[1]]
        now += terms
        self._sums[wall] = begin, sums
        return now

    def split(self, wall: int) -> None:
        """Forget a wall that gives way to its two sides."""
        self._sums.pop(wall, None)

    def keep_apart(self, one: int, other: int) -> None:
        """Take note that two walls are the sides of a bend."""
        self._cut.add((min(one, other), max(one, other)))

    def merge(self, keep: int, drop: int) -> None:
        """Take note that two entries were one wall; what was said of `drop`, at places of its own, is forgotten."""
        self._sums.pop(drop, None)
        renamed = ([keep if wall == drop else wall for wall in pair] for pair in self._cut)
        self._cut = {(min(pair), max(pair)) for pair in renamed if pair[0] != pair[1]}


def _turns(
    along: Float[np.ndarray, " k"],
    across: Float[np.ndarray, " k"],
    sigma: Float[np.ndarray, " k"],
    places: Float[np.ndarray, " p"],
) -> Sums:
    """Return the sums of beams at `along`, off a line by `across`, m, whatever the line: by how much more per metre the
    wall leads away beyond each place.
    """
    weight = 1.0 / np.square(sigma)
    line = np.stack([np.ones_like(along), along - along.mean()], axis=-1)
    turned = np.maximum(along[:, None] - places, 0.0)
    turned -= line @ np.linalg.solve(line.T @ (weight[:, None] * line), line.T @ (weight[:, None] * turned))
    return np.stack([weight @ np.square(turned), (weight * across) @ turned])


def sides_of(kink: Kink, segments: Segments, pieces: Segments, scan: Scan) -> tuple[int, int] | None:
    """Return the neighbours among `pieces`, of the same scan cut at a bend, between which it lies; None without two."""
    beams, margin = len(scan.bearings_rad), 2
    first, last = segments.beams[kink.segment] + [-margin, margin]  # a beam in doubt may have been left to either
    run = np.mod(pieces.beams - first, beams)
    ours = np.flatnonzero((run[:, 0] <= run[:, 1]) & (run[:, 1] <= np.mod(last - first, beams)))
    if len(ours) < 2:
        return None
    ours = ours[np.argsort(run[ours, 0])]
    step = (scan.bearings_rad[-1] - scan.bearings_rad[0]) / (beams - 1)
    bend = np.mod(np.mod(kink.bearing_rad - scan.bearings_rad[0], 2.0 * np.pi) / step - first, beams)
    nearest = int(np.argmin(np.abs(0.5 * (run[ours[:-1], 1] + run[ours[1:], 0]) - bend)))
    return int(ours[nearest]), int(ours[nearest + 1])
