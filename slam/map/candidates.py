"""Faces of a few beams only: door ends, pilasters. A line becomes a wall once it is seen from several places.

Three beams across a corner make a line too, but a different one from every place; a real face stays where it is.
Until then the line is no part of the stochastic map, so that what comes and goes costs the back ends nothing.
"""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ..estimation.gates import gate_level
from ..estimation.shared import SharedConfig, of_shared
from ..extraction.segments import Segments
from ..robot import RobotSpec, of_robot
from .kernels.few_beams_kernels import Rules, see


@dataclass(frozen=True)
class CandidatesConfig:
    """When a line of few beams is believed: seen from several places, half a step of the robot from one another.

    From one place the same beams make the same line again.
    """

    robot: RobotSpec = of_robot()
    shared: SharedConfig = of_shared()
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


class LandmarkCandidates:
    """The lines of few beams that may become walls."""

    def __init__(
        self, gate: float, angle_rad: float, sure_beams: int, config: CandidatesConfig = CandidatesConfig()
    ) -> None:
        """Lines of which two observations are farther apart than this gate, or turn by more, are never one.

        All looks together see as many beams more than the two apiece that any line goes through as one segment does
        that is sure.
        """
        self._rules = Rules(
            gate_level(gate, 2),
            float(np.cos(angle_rad)),
            config.shared.scans,
            0.5 * config.robot.step_m,
            sure_beams - 2,
            float(config.longest_m),
            config.patience_steps,
            float(config.slack_m),
        )
        self._lines, self._places = np.zeros((0, 6)), np.zeros((0, 2))
        self._looks, self._spare_beams, self._unseen = np.zeros((3, 0), dtype=np.int64)

    def see(self, pose_world: Float[np.ndarray, "3"], segments: Segments) -> Int[np.ndarray, " m"]:
        """Take in one scan's segments of few beams, none of which lies on a wall; return those to be believed now.

        A line keeps its first observation, so that it does not wander off step by step.
        """
        seen = segments.lines, segments.cov, segments.ends, segments.beam_counts
        counts = self._looks, self._spare_beams, self._unseen
        believed, fresh, kept, lines = see(pose_world, *seen, self._lines, self._places, *counts, self._rules)
        if len(fresh) or not kept.all():
            new = np.zeros(len(fresh), dtype=np.int64)
            self._lines = np.concatenate([self._lines[kept], lines[fresh]])
            self._places = np.concatenate([self._places[kept], np.tile(pose_world[:2], (len(fresh), 1))])
            self._looks = np.concatenate([self._looks[kept], new + 1])
            self._spare_beams = np.concatenate([self._spare_beams[kept], segments.beam_counts[fresh] - 2])
            self._unseen = np.concatenate([self._unseen[kept], new])
        return np.flatnonzero(believed)
