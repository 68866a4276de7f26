"""All that a factor graph was told: enough to build it again."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Float

from ...geometry.poses import compose, wrap
from ...robot import Odometry
from ..frame.frame import Frame

NEW = -1, -1


@dataclass(eq=False, slots=True)
class Observation:
    """One observation of a line."""

    pose: int
    """Index of the pose from which it was made."""
    seen: tuple[float, float, float, float, float]
    """alpha rad, r m, C_alpha_alpha, C_alpha_r, C_r_r, in the robot frame."""
    slots: tuple[int, int] = NEW
    """Where its two factors stand in iSAM2."""
    epsilon: float = 0.0
    """By how much it departs from its line, rad, as far as the noise of its distance depends on that."""


@dataclass
class Line:
    """One line and its observations."""

    anchor: Float[np.ndarray, "2"]
    """World frame, m."""
    observations: list[Observation] = field(default_factory=list)
    shown: bool = True
    """A line that was forgotten after several observations is no longer shown, but what it said of the rest stays."""


@dataclass
class Record:
    """Prior, odometry and observations in the order in which they came."""

    frame: Frame
    """Where pose 0 lies in the world, as far as prior and odometry tell: everything in the map is relative to it."""
    lead: list[Float[np.ndarray, "3"]] = field(default_factory=list)
    """Poses before pose 0, where the first wall came into sight, world frame: no scan says more of them."""
    motions: list[Odometry] = field(default_factory=list)
    """How the robot came to pose k + 1 from pose k."""
    steps: list[int] = field(default_factory=lambda: [0])
    """Motions made after each prediction (a rest without any error makes none), none at the start."""
    lines: dict[int, Line] = field(default_factory=dict)
    """By id, ascending."""
    next_id: int = 0
    fresh: list[tuple[int, Observation]] = field(default_factory=list)
    """Observations since the last solution, each with the id of its line."""

    def move(self, odometry: Odometry) -> None:
        """Note a motion; a rest without any error makes no new pose."""
        if np.any(odometry.motion) or np.any(odometry.cov):
            if self.next_id:
                self.motions.append(Odometry(np.array(odometry.motion, float), np.array(odometry.cov, float)))
            else:
                self.lead.append(self.frame.pose_world)
                self.frame = self.frame.moved(odometry)
        self.steps.append(len(self.lead) + len(self.motions))

    def begin(self, anchors: Float[np.ndarray, "m 2"]) -> list[int]:
        """Note new lines by their anchors, world frame, and return their ids."""
        ids = list(range(self.next_id, self.next_id + len(anchors)))
        self.next_id += len(ids)
        self.lines |= {line: Line(anchor) for line, anchor in zip(ids, anchors, strict=True)}
        return ids

    def see(
        self, pose: int, line: int, seen: Float[np.ndarray, "2"], cov: Float[np.ndarray, "2 2"], epsilon: float
    ) -> Observation:
        """Note an observation that departs from its line by epsilon, rad, and return it."""
        (alpha, r), ((along, cross), (_, across)) = seen.tolist(), cov.tolist()
        observation = Observation(pose, (alpha, r, along, cross, across), epsilon=epsilon)
        self.lines[line].observations.append(observation)
        self.fresh.append((line, observation))
        return observation

    def weigh(self, poses: Float[np.ndarray, "p 3"], lines: Float[np.ndarray, "n 2"]) -> None:
        """Let the observations have the noise that they have at these poses and lines of the graph."""
        for known, (alpha, _) in zip(self.lines.values(), lines, strict=True):
            for observation in known.observations:
                observation.epsilon = float(wrap(observation.seen[0] - alpha + poses[observation.pose, 2]))

    def take_back(self) -> list[int]:
        """Forget the observations since the last solution; return the lines that none is left of."""
        for line, observation in self.fresh:
            self.lines[line].observations.remove(observation)
        self.fresh, gone = [], [line for line, known in self.lines.items() if not known.observations]
        for line in gone:
            del self.lines[line]
        return gone

    def path_world(self, poses: Float[np.ndarray, "p 3"]) -> Float[np.ndarray, "n 3"]:
        """Return the pose at the start and after every prediction, given the poses from pose 0 on in its frame."""
        path = [*self.lead, *(compose(self.frame.pose_world, pose) for pose in poses)]
        return np.array([path[k] for k in self.steps])
