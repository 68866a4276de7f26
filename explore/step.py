"""One turn of the closed loop, frozen; timelines, scores, progress bars and log writers iterate over these."""

from __future__ import annotations

from dataclasses import dataclass, field

import networkx as nx
import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.association.matching import Matches
from chainslam.slam.association.ranges.errors import RangeErrors
from chainslam.slam.association.recovery import Localisation
from chainslam.slam.extraction.segments import Segments
from chainslam.slam.map.chains import Chain
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import Odometry, RobotSpec, Scan

from .floor.free_space import FreeSpace
from .goal import SetAside
from .goals.decider import Decision
from .outcome import Outcome


@dataclass(frozen=True, kw_only=True)
class Step:
    """Everything that one turn of sense, map, choose, drive has seen and decided."""

    index: int
    time_s: float
    odometry: Odometry
    """The motion that led here (zero at the first step)."""
    scan: Scan
    segments: Segments
    matches: Matches
    walls_of_segments: Int[np.ndarray, " s"]
    """For each segment the id of the wall that it was fused into or began; -1 where it was not used, or has few beams:
    `matches` has these."""
    map: StochasticMap
    """`map.belief.pose_world` is the estimate available at this step; `belief.joint` answers only until the next."""
    chains: tuple[Chain, ...]
    free_space: FreeSpace
    """A view that the mission goes on updating: read it at once or copy it."""
    graph: nx.DiGraph[int]
    """The visibility graph, likewise."""
    decision: Decision
    """The command with its goal, and why; at the last step, why the mission is over."""
    path_length_m: float
    """By odometry, so far."""
    seconds: float
    """Wall-clock time of this step, sense to command."""
    planning_seconds: float
    """Processor time of what the step decided: the visibility graph, the choice, the way, the command."""
    merged: tuple[tuple[int, int], ...] = ()
    """Ids (kept, dropped) of the walls that this scan showed to be one."""
    localisation: Localisation = field(default_factory=Localisation)
    """How well the scan fits where the robot was believed to be, and what was made of that."""
    own_beams: int = 0
    """So many beams of the scan ended on the robot itself, and were taken to tell nothing."""
    range_errors: RangeErrors = field(default_factory=RangeErrors)
    """What is wrong with the scanner's ranges, as far as all scans up to now tell."""
    robot: RobotSpec = RobotSpec()
    """What the robot states of itself: its body, and where on it the scan was taken."""

    @property
    def set_aside(self) -> tuple[SetAside, ...]:
        """The ends that were set aside and are open still."""
        open_ends = {(end.wall, end.side) for chain in self.chains for end in chain.open_ends}
        return tuple(end for end in self.decision.given_up.ends if (end.wall, end.side) in open_ends)

    @property
    def outcome(self) -> Outcome | None:
        """Why the mission is over, at its last step, else None."""
        return self.decision.outcome

    @property
    def ended(self) -> str | None:
        """`complete` or `stopped` at the last step, else None."""
        return None if self.outcome is None else self.outcome.status

    @property
    def pose_world(self) -> Float[np.ndarray, 3]:
        """The estimated pose."""
        return self.map.belief.pose_world
