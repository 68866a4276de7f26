"""How likely it is that a wall exists: the odds that its first segment is of one face, and what each look says since.

A line over two faces is seen again as well, but not from everywhere: from near by, where more beams reach it than a
segment needs, the faces are seen in its place. So a look counts for a wall that shows it, and against one that does not
where so many beams end on it or go on beyond it. From one place the same beams show the same again: that is one look.
"""

from dataclasses import dataclass
from math import inf, log

import numpy as np
from jaxtyping import Bool, Float, Int

from ..estimation.gates import gate_level
from ..estimation.shared import SharedConfig, of_shared
from ..extraction.segments import Segments
from ..geometry.quantities import Distance, Probability
from ..robot import RobotSpec, Scan, of_robot
from .kernels.existence_kernels import Odds
from .kernels.few_beams_kernels import Same, lines_of, looked

JUST_BEGUN = np.full(2, np.nan)
"""The place of the last look at a wall that begins in this scan."""
NOWHERE = np.full(2, np.inf)
"""And of one that was not looked at since."""


@dataclass(frozen=True)
class ExistenceConfig:
    """Probabilities by which a wall is believed to exist.

    They are shares in apartments, by the true faces of segments and walls.
    """

    robot: RobotSpec = of_robot()
    shared: SharedConfig = of_shared()
    over_faces: Probability = 0.07
    """Share of the new segments with `sure_beams` beams or more that span two faces."""
    few_over_faces: Probability = 0.27
    """Share of the new segments with fewer beams that span two faces."""
    shown: Probability = 0.9
    """Probability that a scan with enough beams on a wall shows it, if it is a single face."""
    shown_over_faces: Probability = 0.2
    """Probability that a scan with enough beams on a wall shows it, if it spans two faces."""
    few_shown_over_faces: Probability = 0.5
    """Probability that a scan shows a candidate with few beams again, if it spans two faces."""
    slack_m: Distance = 0.01
    """Standard deviation of the pose's drift between two observations of a candidate with few beams."""

    def odds(self, sure_beams: int) -> Odds:
        """Return what a look says of a wall, as logarithms of odds; a segment is sure with so many beams."""
        return self._odds(self.shown_over_faces, sure_beams + 2)

    def few_odds(self, least_beams: int) -> Odds:
        """Return what a look says of a line of few beams; so many make a segment."""
        return self._odds(self.few_shown_over_faces, least_beams)

    def _odds(self, shown_over_faces: float, beams: int) -> Odds:
        return Odds(
            _log(self.shown) - _log(shown_over_faces),
            _log(1.0 - self.shown) - _log(1.0 - shown_over_faces),
            self.most,
            beams,
            0.5 * self.robot.step_m,
            float(self.shared.beams_m),
        )

    @property
    def believed(self) -> float:
        """A wall is believed once more than one sure segment speaks for it: log odds above these."""
        return log_odds(1.0 - self.over_faces)

    @property
    def most(self) -> float:
        """No wall is surer: what is ruled out by chance lets none be. In log odds."""
        return log_odds(1.0 - self.shared.chance)

    def begins(self, is_tentative: Bool[np.ndarray, " s"]) -> Float[np.ndarray, " s"]:
        """Return the log odds that segments are of one face, by whether they have few beams."""
        return np.where(is_tentative, log_odds(1.0 - self.few_over_faces), self.believed)


def log_odds(probability: float) -> float:
    """Return the logarithm of p / (1 - p); infinite for what is certain."""
    return _log(probability) - _log(1.0 - probability)


def _log(probability: float) -> float:
    return log(probability) if probability > 0.0 else -inf


class LandmarkCandidates:
    """The lines of few beams that may become walls: door ends, pilasters, and lines across corners.

    Three beams across a corner make a line too, but a different one from every place; a real face stays where it is.
    Until a line is likely enough to be a wall it is no part of the stochastic map, so that what comes and goes costs
    the back ends nothing.
    """

    def __init__(self, gate: float, angle_rad: float, least_beams: int, config: ExistenceConfig) -> None:
        """Lines of which two observations are farther apart than this gate, or turn by more, are never one.

        So many beams make a segment.
        """
        self._same = Same(gate_level(gate, 2), float(np.cos(angle_rad)), float(config.slack_m))
        self._config, self._odds, self._believed = config, config.few_odds(least_beams), config.believed
        self._lines, self._places, self._log_odds = np.zeros((0, 6)), np.zeros((0, 2)), np.zeros(0)

    def __len__(self) -> int:
        return len(self._lines)

    def see(
        self, pose_world: Float[np.ndarray, "3"], scan: Scan, segments: Segments, few: Int[np.ndarray, " f"]
    ) -> tuple[Int[np.ndarray, " m"], Float[np.ndarray, " m"]]:
        """Take in one scan, of which these `few` segments have few beams and lie on no wall.

        Returns those to be believed now, and the log odds that they are walls. A line keeps its first observation, so
        that it does not wander off step by step.
        """
        lines = lines_of(pose_world, segments.lines[few], segments.cov[few], segments.ends[few])
        known, rays = self._lines, (pose_world, scan.bearings_rad, scan.passed_m)
        line_of = looked(*rays, lines, known, self._log_odds, self._places, self._same, self._odds)
        due = self._log_odds > self._believed
        believed = (line_of >= 0).nonzero()[0]
        believed = believed[due[line_of[believed]]]
        log_odds = self._log_odds[line_of[believed]]
        kept = ~due & (self._log_odds >= 0.0)
        fresh = (line_of < 0).nonzero()[0]
        if len(fresh) or not kept.all():
            self._lines = np.concatenate([known[kept], lines[fresh]])
            self._places = np.concatenate([self._places[kept], np.tile(NOWHERE, (len(fresh), 1))])
            begun = self._config.begins(segments.is_tentative[few[fresh]])
            self._log_odds = np.concatenate([self._log_odds[kept], begun])
        return few[believed], log_odds
