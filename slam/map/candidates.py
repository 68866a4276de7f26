"""Faces of a few beams only: door ends, pilasters. A line becomes a wall once it is likely enough to be one.

Three beams across a corner make a line too, but a different one from every place; a real face stays where it is.
Until then the line is no part of the stochastic map, so that what comes and goes costs the back ends nothing.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ..estimation.gates import gate_level
from ..extraction.segments import Segments
from ..robot import Scan
from .existence import NOWHERE, ExistenceConfig, log_odds, looked_at, rows_without
from .kernels.few_beams_kernels import Same, distances, lines_of, paired


@dataclass(frozen=True)
class CandidatesConfig:
    """When two lines of few beams may be one."""

    slack_m: float = 0.01
    """What the pose may have drifted between two observations, sigma."""


class LandmarkCandidates:
    """The lines of few beams that may become walls."""

    def __init__(
        self,
        gate: float,
        angle_rad: float,
        sure_beams: int,
        config: CandidatesConfig = CandidatesConfig(),
        existence: ExistenceConfig = ExistenceConfig(),
    ) -> None:
        """Lines of which two observations are farther apart than this gate, or turn by more, are never one.

        The gate is also how sure it has to be that a line is a wall.
        """
        self._same = Same(gate_level(gate, 2), float(np.cos(angle_rad)), float(config.slack_m))
        self._existence, self._odds, self._sure = existence, existence.odds(sure_beams), log_odds(gate)
        self._lines, self._places, self._log_odds = np.zeros((0, 6)), np.zeros((0, 2)), np.zeros(0)

    def see(self, pose_world: Float[np.ndarray, "3"], scan: Scan, segments: Segments) -> Int[np.ndarray, " m"]:
        """Take in one scan, of which `segments` have few beams and lie on no wall; return those to be believed now.

        A line keeps its first observation, so that it does not wander off step by step.
        """
        lines, known = lines_of(pose_world, segments.lines, segments.cov, segments.ends), self._lines
        line_of = paired(distances(lines, known, self._same))
        seen = np.zeros(len(known), dtype=bool)
        seen[line_of[line_of >= 0]] = True
        of_known = known[:, 1:3].copy(), np.column_stack([known[:, 0], np.zeros(len(known))]), known[:, 5:] * [-1.0, 1.0]
        looked_at(pose_world, scan, of_known, seen, (self._log_odds, self._places), self._odds)
        due = self._log_odds >= self._sure
        believed = np.flatnonzero((line_of >= 0) & due[line_of]) if len(known) else np.zeros(0, dtype=np.int64)
        kept = ~due
        kept[rows_without(self._log_odds)] = False
        fresh = np.flatnonzero(line_of < 0)
        if len(fresh) or not kept.all():
            self._lines = np.concatenate([known[kept], lines[fresh]])
            self._places = np.concatenate([self._places[kept], np.tile(NOWHERE, (len(fresh), 1))])
            begun = self._existence.begins(segments.is_tentative[fresh])
            self._log_odds = np.concatenate([self._log_odds[kept], begun])
        return believed
