"""Which observations may move the estimate: those of a clear direction, on walls of which all observations agree.

Around a corner of short faces a line fits six beams of each scan well enough, and another line from every place. What
makes the direction clear is then that it took in a beam of the next face: the observations that are let through are the
wrong ones. One scan cannot tell such a line from a wall; all scans together can.
"""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Int
from scipy.special import gammaincc

from ..estimation.gates import gate_level
from ..estimation.shared import SharedConfig, of_shared
from ..extraction.segments import Segments
from ..extraction.straightness import StraightnessConfig, cov_of_faces
from ..geometry.poses import wrap
from .kernels import reliability_kernels
from .kernels.reliability_kernels import add_directions, add_fits, in_conflict
from .records import Merger, Records


@dataclass(frozen=True)
class ReliabilityConfig:
    """When a direction is clear, and when a wall is not straight."""

    shared: SharedConfig = of_shared()
    heading_rad: float = 0.15
    """A segment with a larger sigma of direction, that of short faces included (`straightness`), is matched and stored
    but moves no estimate: where a line's direction keeps changing by many degrees, so does the direction in which it
    fixes the robot, and every change adds information that was never measured. One of fewer than five beams moves the
    estimate only where its turn is known (`shared.known_rad`): along a wall seen at a grazing angle they are as good as
    they say, above this they hold beams of other walls too often."""
    excess: float = 1.2
    """Chi-square over degrees of freedom of all fits: misfits of 0.45 times the noise. Smaller ones any real wall shows
    over thousands of beams."""
    chance: float = 1e-5
    """Straight walls are taken for crooked this rarely by either test."""
    straightness: StraightnessConfig = field(default_factory=StraightnessConfig)
    """How far a face may be from its line."""


def are_clear(segments: Segments, config: ReliabilityConfig = ReliabilityConfig()) -> Bool[np.ndarray, " s"]:
    """Return which segments have enough beams and a clear direction."""
    turn = segments.cov[:, 0, 0] + cov_of_faces(segments, config.straightness)[:, 0, 0]
    return ~segments.is_tentative & (turn < config.heading_rad**2)


def as_told(
    cov: Float[np.ndarray, "m 2 2"], segments: Segments, config: ReliabilityConfig = ReliabilityConfig()
) -> Float[np.ndarray, "m 2 2"]:
    """Return the covariances of (alpha, r) of observations that together move the estimate; `few` show few beams.

    Beside a clear observation one of few beams says where the robot stands, not how it is turned: such a line over the
    corner of two faces of one wall passes every gate. It may be turned about the point at which what is known of its
    place does not depend on its direction; there r changes by cov(alpha, r) / var(alpha) for every radian.
    """
    cov = cov + cov_of_faces(segments, config.straightness)
    return reliability_kernels.as_told(cov, segments.is_tentative, float(config.heading_rad))


class Reliability:
    """Sums over the observations of each wall."""

    def __init__(self, config: ReliabilityConfig = ReliabilityConfig(), records: Records | None = None) -> None:
        self._config = config
        self._records = Records() if records is None else records
        self._records.declare(
            self._merge,
            fits=np.zeros(2),
            first=np.nan,
            directions=np.zeros((2, 2)),
            crooked=False,
            # Squared residuals beyond those of the noise, m^2, their variance by noise alone, and of how many beams.
            residue=np.zeros(3),
        )

    def see(self, segments: Segments, owners: Int[np.ndarray, " s"], pose_world: Float[np.ndarray, "3"]) -> None:
        """Add one scan, taken at a pose in the world; `owners` holds the wall of each segment, -1 for none."""
        used = (owners >= 0) & (segments.cov[:, 0, 0] > 0.0)
        ids, seen = owners[used], segments.take(used)
        rows, columns = self._records.rows(ids), self._records.columns
        add_fits(rows, seen.cov, seen.chi2, seen.beam_counts, columns["fits"], columns["residue"])
        alpha, clear = seen.lines[:, 0] + pose_world[2], are_clear(seen, self._config)
        add_directions(rows, alpha, seen.cov, clear, columns["first"], columns["directions"])
        self._judge(rows)

    def _judge(self, rows: Int[np.ndarray, " n"]) -> None:
        """Take note of which walls are surely not straight."""
        crooked = self._misfit(rows) | self._in_conflict(rows)
        self._records.columns["crooked"][rows] = crooked

    def _merge(self, merger: Merger) -> None:
        """Add the sums of the dropped wall, taken about its own first observation, to those about the kept one's."""
        columns, keep, drop = self._records.columns, merger.keep, merger.drop
        first, fits, sums = (columns[name] for name in ("first", "fits", "directions"))
        fits[keep] += fits[drop]
        columns["residue"][keep] += columns["residue"][drop]
        if np.isnan(first[drop]):
            return
        if np.isnan(first[keep]):
            first[keep] = first[drop]
        information, off = sums[drop].T
        sums[keep] += np.column_stack([information, off + wrap(first[drop] - first[keep]) * information])
        self._judge(np.array([keep]))

    def may_move(self, segments: Segments, ids: Int[np.ndarray, " s"]) -> Bool[np.ndarray, " s"]:
        """Return which segments of one scan, each on the wall of that id, may move the estimate.

        Where nothing else would, a crooked wall does: it bends by a degree or two, which the wheels lose in 0.2 m.

        A few beams tell where the robot stands, not where the wall does: its clear observations together know its
        direction better. Three beams from one wall's corner over the next to a third are a line, known to 0.1 degrees
        and 90 off, within the gate of a wall of vague direction.
        """
        rows, columns = self._records.rows(ids), self._records.columns
        clear, few_rad = are_clear(segments, self._config), float(self._config.shared.known_rad)
        told = segments.is_tentative, segments.cov, clear, rows
        return reliability_kernels.may_move(*told, columns["crooked"], columns["directions"], few_rad)

    def are_crooked(self, ids: Int[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
        """Return which walls are surely not straight: by their fits, or by what vague and clear observations say."""
        rows = self._records.rows(ids)
        crooked: Bool[np.ndarray, " n"] = self._records.columns["crooked"][rows]
        return crooked

    def misfits(self, ids: Int[np.ndarray, " n"]) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
        """Return how far the faces of walls are off their line: variances in m^2 across it and in rad^2.

        Of two faces that meet in a corner each is off the line through both by twice what their residuals show; where
        what is vague and what is clear disagree, the clear ones have moved the line to where the others are not. What
        noise alone may show counts nothing: a straight wall lies on its line however often it was seen.
        """
        rows, columns = self._records.rows(ids), self._records.columns
        sigmas = float(self._config.shared.outlier_sigmas)
        return reliability_kernels.misfits(columns["residue"][rows], columns["directions"][rows], sigmas)

    @property
    def _level(self) -> float:
        """The squared difference of two directions, in its own variances, that chance leaves straight walls below."""
        return gate_level(1.0 - self._config.chance, 1)

    def _misfit(self, rows: Int[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
        chi2, dof = self._records.columns["fits"][rows].T
        misfit = chi2 > self._config.excess * dof
        if misfit.any():
            misfit[misfit] = gammaincc(0.5 * dof[misfit], 0.5 * chi2[misfit]) < self._config.chance
        return misfit

    def _in_conflict(self, rows: Int[np.ndarray, " n"]) -> Bool[np.ndarray, " n"]:
        return in_conflict(self._records.columns["directions"][rows], self._level)
