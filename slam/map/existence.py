"""How likely it is that a wall exists: the odds that its first segment is of one face, and what each look says since.

A line over two faces is seen again as well, but not from everywhere: from near by, where more beams reach it than a
segment needs, the faces are seen in its place. So a look counts for a wall that shows it, and against one that does not
where so many beams end on it or go on beyond it. From one place the same beams show the same again: that is one look.
"""

from dataclasses import dataclass
from math import log

import numpy as np
from jaxtyping import Bool, Float

from ..estimation.shared import SharedConfig, of_shared
from ..robot import RobotSpec, Scan, of_robot
from .kernels.existence_kernels import Odds, crossing, look

JUST_BEGUN = np.full(2, np.nan)
"""The place of the last look at a wall that begins in this scan."""
NOWHERE = np.full(2, np.inf)
"""And of one that was not looked at since."""


@dataclass(frozen=True)
class ExistenceConfig:
    """What the first segment and each look say: shares in apartments, by true faces (docs/association.md)."""

    robot: RobotSpec = of_robot()
    shared: SharedConfig = of_shared()
    over_faces: float = 0.03
    """Of segments with enough beams to be sure, so many lie over two faces ..."""
    few_over_faces: float = 0.15
    """... and of those with fewer."""
    shown: float = 0.9
    """A look shows a wall, where two beams more reach it than make a sure segment, one for each end that may lose its
    last: so often where there is one ..."""
    shown_over_faces: float = 0.2
    """... and so often where the line lies over two faces."""
    slack_m: float = 0.01
    """What the pose may have drifted between two observations of a line of few beams, sigma."""

    def odds(self, sure_beams: int) -> Odds:
        """Return them as logarithms of odds, for segments that are sure with so many beams."""
        return Odds(
            log(self.shown / self.shown_over_faces),
            log((1.0 - self.shown) / (1.0 - self.shown_over_faces)),
            self.most,
            sure_beams + 2,
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
    """Return the logarithm of p / (1 - p)."""
    return log(probability / (1.0 - probability))


def looked_at(
    pose_world: Float[np.ndarray, "3"],
    scan: Scan,
    lines: tuple[Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"], Float[np.ndarray, "n 2"]],
    seen: Bool[np.ndarray, " n"],
    unsure: Bool[np.ndarray, " n"],
    columns: tuple[Float[np.ndarray, " n"], Float[np.ndarray, "n 2"]],
    odds: Odds,
) -> None:
    """Take one scan into the log odds and the places of the last looks, in place.

    `lines` are anchors, means (alpha rad, d m) and extents, m, world frame; `seen` are those that the scan
    shows; of the others it may show those that are `unsure`, and says nothing of them.
    """
    beams = crossing(scan.bearings_rad, scan.passed_m, float(scan.range_max_m), pose_world, *lines, odds.margin_m)
    beams[unsure] = 0
    look(pose_world, beams, seen, *columns, odds)
