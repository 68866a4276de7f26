"""Walls that are surely two faces: what all scans together draw of a step of centimetres that none of them shows.

One line fits the few beams that a scan has on two short faces with a step of 2 cm between them. It is turned by
degrees, in every scan alike, and so the map becomes sure of it. But each beam ended where the face is: summed over all
scans, piece by piece along the wall, the beams draw the faces, whatever lines were laid through them.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
from jaxtyping import Float

from ...estimation.backend import POSE, Belief, Joint
from ...estimation.gates import gate_level
from ...estimation.models import lines_robot
from ...geometry.lines import directions, normals
from ...geometry.matrix_kernels import wrapped
from ...geometry.poses import to_robot
from ..extents import WallsConfig
from ..records import Records
from .kernels.split_kernels import Bins, Fit, best_split, binned, fitted, placed
from .wall_beams import WallBeams, with_more


@dataclass(frozen=True)
class Split:
    """The faces that take the place of a wall, p of them: two, or one where the other is too short for a direction."""

    wall: int
    """Its id."""
    lines: Float[np.ndarray, "p 2"]
    """(alpha, r) of each, as the robot would see it."""
    cov: Float[np.ndarray, "p 2 2"]
    """What all scans state of them, and how far poses may have been off alike in all."""
    centres: Float[np.ndarray, "p 2"]
    """Robot frame, m."""
    extents: Float[np.ndarray, "p 2"]
    """From and to, m along each from its centre."""


class Side(NamedTuple):
    """What the beams before or after a step say."""

    fit: Fit
    begins_m: float
    """Along the reference line."""
    ends_m: float


class Splits:
    """Where the beams of all scans lie along each wall, about the line that it had when it was first seen again.

    Of a wall that was merged into another they are forgotten.
    """

    def __init__(self, config: WallsConfig, records: Records) -> None:
        """Keep the sums in these records."""
        self._shared, self._reliability = config.shared, config.reliability
        self._level = gate_level(1.0 - config.shared.chance, 2)
        self._records = records
        self._records.declare(reference=np.full(2, np.nan), bins=None)

    def see(
        self, belief: Belief, seen: WallBeams, off_line_cov: Callable[[int], Float[np.ndarray, "2 2"]]
    ) -> Split | None:
        """Add one scan; return the faces of a wall that it shows and that is surely two of them, if any.

        `off_line_cov` tells how far the wall of an id may be off its line, (alpha, d).
        """
        rows, columns = self._records.rows(seen.walls), self._records.columns
        new = rows[np.isnan(columns["reference"][rows, 0])]
        columns["reference"][new] = belief.means[new]
        anchors, references = belief.anchors[rows], columns["reference"][rows]
        ends = placed(seen.lines, belief.pose_world, anchors, references, seen.feet, seen.along, seen.across, seen.of)
        weights = 1.0 / (seen.sigma**2 + self._reliability.edge_m**2)
        bounds = np.searchsorted(seen.of, np.arange(len(rows) + 1)).tolist()
        for row, start, stop in zip(rows.tolist(), bounds[:-1], bounds[1:], strict=True):
            if start < stop:
                self._add(row, *binned(ends[:, start:stop], weights[start:stop], self._shared.resolution_m))
                sides = self._sides(belief, row, off_line_cov)
                if sides:
                    return self._split(belief, row, sides)
        return None

    def _add(self, row: int, first: int, more: Bins) -> None:
        """Add to a wall's sums from its piece `first` on."""
        bins = self._records.columns["bins"]
        bins[row] = with_more(bins[row], first, more)

    def _sides(
        self, belief: Belief, row: int, off_line_cov: Callable[[int], Float[np.ndarray, "2 2"]]
    ) -> tuple[Side, Side] | None:
        """Return what lies before and after a step, if two lines fit better and the wall is neither of them.

        Only a short face turns the line through both: between two long ones nothing is sought. There poses that were
        off alike in many scans would draw steps of millimetres.

        Beside a pilaster a long wall is two lines, too, but it is one of them: nothing is wrong with it.
        """
        shared, (begin, bins) = self._shared, self._records.columns["bins"][row]
        pitch_m, (low, high) = shared.resolution_m, self._records.columns["extents"][row].tolist()
        first, last = max(int(low // pitch_m) - begin, 0), min(int(-(-high // pitch_m)) - begin, bins.shape[1])
        reach, least = round(shared.short_m / pitch_m), round(shared.thickness_m / pitch_m)
        at, gain = best_split(bins, first, last, reach, least)
        if gain <= self._level:
            return None
        windows: list[tuple[int, int]] = [(max(at - reach, first), at), (at, min(at + reach, last))]
        faces = [fitted(bins, *window, 0.0) for window in windows]
        beams = int(sum(face.beams for face in faces))
        # Beams from before a loop was closed and after it lie on no two lines; nobody knows which of them are right.
        if sum(face.chi_square for face in faces) > gate_level(1.0 - shared.chance, max(beams - 4, 1)):
            return None
        # What is stated of the wall only brings faces nearer to it; a graph takes a millisecond to tell it.
        if not self._is_neither(belief, row, faces, np.zeros((2, 2))):
            return None
        if not self._is_neither(belief, row, faces, self._stated(belief, row, off_line_cov)):
            return None
        step_m, off_m = (begin + at) * pitch_m, self._reliability.edge_m
        return Side(fitted(bins, first, at, off_m), low, step_m), Side(fitted(bins, at, last, off_m), step_m, high)

    def _is_neither(self, belief: Belief, row: int, faces: list[Fit], stated: Float[np.ndarray, "2 2"]) -> bool:
        """Return whether one face is surely not where the wall is, and the other hardly, as well as it is known."""
        squares = self._squares(belief, row, faces, stated)
        return max(squares) > self._level and min(squares) > self._shared.outlier_sigmas**2

    def _stated(
        self, belief: Belief, row: int, off_line_cov: Callable[[int], Float[np.ndarray, "2 2"]]
    ) -> Float[np.ndarray, "2 2"]:
        """Return how well the wall is known from where the robot is, (alpha, d)."""
        wall = self._records.ids[row : row + 1]
        return _lines_given_pose(belief.joint(wall)) + off_line_cov(int(wall[0]))

    def _squares(self, belief: Belief, row: int, fits: list[Fit], stated: Float[np.ndarray, "2 2"]) -> list[float]:
        """Return how far faces are from where the map has the wall, as squared Mahalanobis distances."""
        alpha, d = self._records.columns["reference"][row].tolist()
        turn, off_m = wrapped(float(belief.means[row, 0]) - alpha), float(belief.means[row, 1]) - d
        squares = []
        for fit in fits:
            off = np.array([-np.arctan(fit.slope) - turn, fit.across - off_m + fit.along * turn])
            to_middle = np.array([[1.0, 0.0], [-fit.along, 1.0]])
            cov = np.diag([fit.slope_var, fit.across_var]) + to_middle @ stated @ to_middle.T
            squares.append(float(off @ np.linalg.solve(cov, off)))
        return squares

    def _split(self, belief: Belief, row: int, sides: tuple[Side, Side]) -> Split:
        """Return the faces that are long enough to have a direction, as the robot would see them."""
        told = [side for side in sides if side.fit.slope_var < self._reliability.heading_rad**2]
        along, across, slope, across_var, slope_var = np.array([side.fit[:5] for side in told]).reshape(-1, 5).T
        reference, pose = self._records.columns["reference"][row], belief.pose_world
        t, n = directions(reference[0]), normals(reference[0])
        centres = belief.anchors[row] + along[:, None] * t + (reference[1] + across)[:, None] * n
        alpha = reference[0] - np.arctan(slope)
        levers = np.vecdot(directions(alpha), centres - pose[:2])
        G_line, G_pose = np.tile(np.eye(2), (len(told), 1, 1)), np.zeros((len(told), 2, POSE))
        G_line[:, 1, 0] = levers
        G_pose[:, 0, 2], G_pose[:, 1, :2] = -1.0, -normals(alpha)
        fits = np.zeros((len(told), 2, 2))
        fits[:, 0, 0], fits[:, 1, 1] = slope_var, across_var
        wall = self._records.ids[row : row + 1]
        poses = _pose_given_lines(belief.joint(wall))
        from_to = np.array([[side.begins_m, side.ends_m] for side in told]).reshape(-1, 2)
        return Split(
            int(wall[0]),
            lines_robot(pose, centres, np.column_stack([alpha, np.zeros(len(told))])),
            G_line @ fits @ G_line.swapaxes(1, 2) + G_pose @ poses @ G_pose.swapaxes(1, 2),
            to_robot(centres, pose),
            (from_to - along[:, None]) * np.hypot(1.0, slope)[:, None],
        )


def _lines_given_pose(joint: Joint) -> Float[np.ndarray, "s s"]:
    """Return the covariance of lines about a robot whose pose is given."""
    return _given(joint.cov, POSE)


def _pose_given_lines(joint: Joint) -> Float[np.ndarray, "3 3"]:
    """Return the covariance of the pose about lines that are given."""
    return _given(np.roll(joint.cov, -POSE, axis=(0, 1)), len(joint.cov) - POSE)


def _given(cov: Float[np.ndarray, "s s"], known: int) -> Float[np.ndarray, "r r"]:
    """Return the covariance of the rest where the first so many are known."""
    return cov[known:, known:] - cov[known:, :known] @ np.linalg.solve(cov[:known, :known], cov[:known, known:])
