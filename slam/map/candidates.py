"""Faces of a few beams only: door ends, pilasters. A line becomes a wall once it is seen from several places.

Three beams across a corner make a line too, but a different one from every place; a real face stays where it is.
Until then the line is no part of the stochastic map, so that what comes and goes costs the back ends nothing.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.gates import gate_level
from ..extraction.segments import Segments
from ..geometry.lines import directions, lines_to_world, normals
from ..geometry.poses import to_world, wrap
from ..robot import RobotSpec, of_robot


@dataclass(frozen=True)
class CandidatesConfig:
    """When a line of few beams is believed."""

    robot: RobotSpec = of_robot()
    looks: int = 2
    """Places from which it must have been seen ..."""
    apart_m: float = 0.07
    """... so far from one another: from one place the same beams make the same line again."""
    spare_beams: int = 3
    """All looks together saw so many beams more than the two apiece that any line goes through."""
    longest_m: float = 0.18
    """Longer ones are not believed: a face of that length shows five beams from near by, and what shows three or four
    is mostly a line from one wall's corner to the next wall."""
    patience_m: float = 150.0
    """It is forgotten when it was not seen for the steps that so long a way takes: the second look may be on the way
    back."""
    slack_m: float = 0.01
    """What the pose may have drifted between two observations, sigma."""

    @property
    def patience_steps(self) -> int:
        """It is forgotten when it was not seen for so many scans."""
        return self.robot.steps_of(self.patience_m)


@dataclass(frozen=True)
class _Lines:
    """Lines in the world frame, each about the middle of its seen piece."""

    alpha: Float[np.ndarray, " n"]
    centre_world: Float[np.ndarray, "n 2"]
    var_alpha: Float[np.ndarray, " n"]
    var_across: Float[np.ndarray, " n"]
    """Of the distance at the centre, m^2, independent of the direction."""
    half_m: Float[np.ndarray, " n"]
    """Half the length of the seen piece."""

    def take(self, rows: Int[np.ndarray, " m"] | Bool[np.ndarray, " n"]) -> "_Lines":
        """Return the chosen rows."""
        return _Lines(
            self.alpha[rows], self.centre_world[rows], self.var_alpha[rows], self.var_across[rows], self.half_m[rows]
        )

    def join(self, other: "_Lines") -> "_Lines":
        """Return these and then the others."""
        mine, theirs = vars(self).values(), vars(other).values()
        return _Lines(*(np.concatenate(both) for both in zip(mine, theirs, strict=True)))


class LandmarkCandidates:
    """The lines of few beams that may become walls."""

    def __init__(self, gate: float, angle_rad: float, config: CandidatesConfig = CandidatesConfig()) -> None:
        """Lines of which two observations are farther apart than this gate, or turn by more, are never one."""
        self._config, self._level, self._least_cosine = config, gate_level(gate, 2), float(np.cos(angle_rad))
        self._lines = _Lines(np.zeros(0), np.zeros((0, 2)), np.zeros(0), np.zeros(0), np.zeros(0))
        self._places = np.zeros((0, 2))
        self._looks = np.zeros(0, dtype=np.int64)
        self._spare_beams = np.zeros(0, dtype=np.int64)
        self._unseen = np.zeros(0, dtype=np.int64)

    def see(self, pose_world: Float[np.ndarray, "3"], segments: Segments) -> Int[np.ndarray, " m"]:
        """Take in one scan's segments of few beams, none of which lies on a wall; return those to be believed now.

        A line keeps its first observation, so that it does not wander off step by step.
        """
        seen = _lines_of(pose_world, segments)
        short = np.flatnonzero(2.0 * seen.half_m <= self._config.longest_m)
        return short[self._see(pose_world, seen.take(short), segments.beam_counts[short] - 2)]

    def _see(
        self, pose_world: Float[np.ndarray, "3"], seen: _Lines, spare_beams: Int[np.ndarray, " s"]
    ) -> Int[np.ndarray, " m"]:
        self._unseen += 1
        line_of = self._line_of(seen)
        again = np.flatnonzero(line_of >= 0)
        rows = line_of[again]
        self._unseen[rows] = 0
        moved = np.hypot(*(pose_world[:2] - self._places[rows]).T) >= self._config.apart_m
        self._looks[rows[moved]] += 1
        self._spare_beams[rows[moved]] += spare_beams[again[moved]]
        self._places[rows[moved]] = pose_world[:2]
        due = (self._looks >= self._config.looks) & (self._spare_beams >= self._config.spare_beams)
        believed = again[due[rows]]
        self._keep(~due & (self._unseen <= self._config.patience_steps))
        fresh = line_of < 0
        self._append(seen.take(fresh), spare_beams[fresh], pose_world[:2])
        return believed

    def _line_of(self, seen: _Lines) -> Int[np.ndarray, " s"]:
        """Return for each observation the row of the line that it shows again, -1 for none; each line at most once."""
        known = self._lines
        turn = wrap(seen.alpha[:, None] - known.alpha)
        shift = seen.centre_world[:, None] - known.centre_world
        off = np.vecdot(shift, normals(known.alpha))
        along = np.vecdot(shift, directions(known.alpha))
        s00 = seen.var_alpha[:, None] + known.var_alpha
        s01 = along * known.var_alpha
        s11 = seen.var_across[:, None] + known.var_across + along * s01 + self._config.slack_m**2
        d2 = (s11 * turn**2 - 2 * s01 * turn * off + s00 * off**2) / (s00 * s11 - s01**2)
        apart = np.abs(along) >= seen.half_m[:, None] + known.half_m
        d2[apart | (d2 > self._level) | (np.cos(turn) < self._least_cosine)] = np.inf
        line_of = np.full(len(seen.alpha), -1, dtype=np.int64)
        for flat in np.argsort(d2, axis=None)[: np.count_nonzero(np.isfinite(d2))]:
            row, line = divmod(int(flat), d2.shape[1])
            if line_of[row] < 0 and line not in line_of:
                line_of[row] = line
        return line_of

    def _keep(self, kept: Bool[np.ndarray, " n"]) -> None:
        self._lines, self._places = self._lines.take(kept), self._places[kept]
        self._looks, self._unseen = self._looks[kept], self._unseen[kept]
        self._spare_beams = self._spare_beams[kept]

    def _append(self, fresh: _Lines, spare_beams: Int[np.ndarray, " m"], place_world: Float[np.ndarray, "2"]) -> None:
        m = len(fresh.alpha)
        self._lines = self._lines.join(fresh)
        self._places = np.concatenate([self._places, np.tile(place_world, (m, 1))])
        self._looks = np.concatenate([self._looks, np.ones(m, dtype=np.int64)])
        self._spare_beams = np.concatenate([self._spare_beams, spare_beams])
        self._unseen = np.concatenate([self._unseen, np.zeros(m, dtype=np.int64)])


def _lines_of(pose_world: Float[np.ndarray, "3"], segments: Segments) -> _Lines:
    centres = 0.5 * (segments.ends[:, 0] + segments.ends[:, 1])
    var_alpha, covariance = segments.cov[:, 0, 0], segments.cov[:, 0, 1]
    return _Lines(
        lines_to_world(segments.lines, pose_world)[:, 0],
        to_world(centres, pose_world),
        var_alpha,
        segments.cov[:, 1, 1] - covariance**2 / var_alpha,
        0.5 * segments.lengths_m,
    )
