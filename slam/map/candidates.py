"""Lines of few beams that may become walls: door ends, pilasters, and lines across corners.

Three beams across a corner make a line too, but a different one from every place; a real face stays where it is.
Until a line is likely enough to be a wall it is no part of the stochastic map, so that what comes and goes costs the
back ends nothing.
"""

import numpy as np
from jaxtyping import Float, Int

from ..estimation.gates import gate_level
from ..extraction.segments import Segments
from ..robot import Scan
from .existence import NOWHERE, ExistenceConfig, looked_at
from .kernels.few_beams_kernels import Same, distances, lines_of, paired


class LandmarkCandidates:
    """The lines of few beams that were seen and are no walls yet, each with the odds that it is one."""

    def __init__(self, gate: float, angle_rad: float, sure_beams: int, config: ExistenceConfig) -> None:
        """Lines of which two observations are farther apart than this gate, or turn by more, are never one.

        `sure_beams` are those of a sure segment.
        """
        self._same = Same(gate_level(gate, 2), float(np.cos(angle_rad)), float(config.slack_m))
        self._config, self._odds = config, config.odds(sure_beams)
        self._lines, self._places, self._log_odds = np.zeros((0, 6)), np.zeros((0, 2)), np.zeros(0)

    def __len__(self) -> int:
        return len(self._lines)

    def see(
        self, pose_world: Float[np.ndarray, "3"], scan: Scan, segments: Segments
    ) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, " m"]]:
        """Take in one scan, of which `segments` have few beams and lie on no wall.

        Returns those to be believed now, and the log odds that they are walls. A line keeps its first observation, so
        that it does not wander off step by step.
        """
        lines, known = lines_of(pose_world, segments.lines, segments.cov, segments.ends), self._lines
        line_of = paired(distances(lines, known, self._same))
        seen, unsure = np.isin(np.arange(len(known)), line_of), np.zeros(len(known), dtype=bool)
        anchors, alpha_rad, half_m = known[:, 1:3].copy(), known[:, 0], known[:, 5:]
        walls = anchors, np.column_stack([alpha_rad, np.zeros(len(known))]), half_m * [-1.0, 1.0]
        looked_at(pose_world, scan, walls, seen, unsure, (self._log_odds, self._places), self._odds)
        due = self._log_odds > self._config.believed
        believed = np.flatnonzero((line_of >= 0) & due[line_of]) if len(known) else np.zeros(0, dtype=np.int64)
        log_odds = self._log_odds[line_of[believed]]
        kept = ~due & (self._log_odds >= 0.0)
        fresh = np.flatnonzero(line_of < 0)
        if len(fresh) or not kept.all():
            self._lines = np.concatenate([known[kept], lines[fresh]])
            self._places = np.concatenate([self._places[kept], np.tile(NOWHERE, (len(fresh), 1))])
            begun = self._config.begins(segments.is_tentative[fresh])
            self._log_odds = np.concatenate([self._log_odds[kept], begun])
        return believed, log_odds
