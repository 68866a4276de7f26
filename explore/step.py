"""The record of one step of the closed loop, over which timelines, scores, progress bars and log writers iterate."""

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
    """Everything that was observed, estimated and decided in one step: sense, map, choose a goal, drive."""

    index: int
    time_s: float
    odometry: Odometry
    """The motion since the previous step (zero at the first)."""
    scan: Scan
    segments: Segments
    matches: Matches
    walls_of_segments: Int[np.ndarray, " s"]
    """For each segment, the id of the wall that it was fused into or that it started. -1 if it was not used or has few
    beams; `matches` lists the latter."""
    map: StochasticMap
    """`map.belief.pose_world` is the estimate at this step; `belief.joint` is only valid until the next step."""
    chains: tuple[Chain, ...]
    free_space: FreeSpace
    """Shared with the mission, which keeps updating it: read it at once, or copy it."""
    graph: nx.DiGraph[int]
    """The visibility graph, shared in the same way."""
    decision: Decision
    """The command, its goal and the reason; at the last step, why the mission ended."""
    path_length_m: float
    """Path length so far, m, by odometry."""
    seconds: float
    """Wall-clock time of this step, s, from sensing to command."""
    planning_seconds: float
    """Processor time of planning, s: the visibility graph, the goal, the path and the command."""
    merged: tuple[tuple[int, int], ...] = ()
    """Ids (kept, dropped) of the pairs of walls that were merged after this scan."""
    localisation: Localisation = field(default_factory=Localisation)
    """How well the scan fits the predicted pose, and what was corrected."""
    own_beams: int = 0
    """Number of beams of the scan that hit the robot itself and were ignored."""
    range_errors: RangeErrors = field(default_factory=RangeErrors)
    """Bias and scale of the scanner's ranges, estimated from all scans so far."""
    robot: RobotSpec = RobotSpec()
    """Description of the robot: its body, and the place of the scanner on it."""

    @property
    def set_aside(self) -> tuple[SetAside, ...]:
        """The blacklisted open ends that are still open."""
        open_ends = {(end.wall, end.side) for chain in self.chains for end in chain.open_ends}
        return tuple(end for end in self.decision.given_up.ends if (end.wall, end.side) in open_ends)

    @property
    def outcome(self) -> Outcome | None:
        """Why the mission ended, at its last step; otherwise None."""
        return self.decision.outcome

    @property
    def ended(self) -> str | None:
        """`complete` or `stopped` at the last step; otherwise None."""
        return None if self.outcome is None else self.outcome.status

    @property
    def pose_world(self) -> Float[np.ndarray, 3]:
        """The estimated pose: x m, y m, heading rad."""
        return self.map.belief.pose_world
