"""What one step of driving may know."""

from __future__ import annotations

from dataclasses import dataclass, field

import networkx as nx
import numpy as np
from jaxtyping import Float

from chainslam.slam.association.joint_compatibility import NO_NIS, Nis
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import Odometry, Scan

from ..floor.free_space import FreeSpace


@dataclass(frozen=True)
class Surroundings:
    """What one step of driving may know."""

    walls: StochasticMap
    free_space: FreeSpace
    scan: Scan
    recent_robot: Float[np.ndarray, "r 2"] = field(default_factory=lambda: np.zeros((0, 2)))
    """What the scans before this one hit nearby, m, in the robot's frame of now."""
    touched_robot: Float[np.ndarray, "t 2"] = field(default_factory=lambda: np.zeros((0, 2)))
    """What the body touched, likewise."""
    graph: nx.DiGraph[int] = field(default_factory=nx.DiGraph)
    """The visibility graph of the walls."""
    odometry: Odometry = field(default_factory=lambda: Odometry(np.zeros(3), np.zeros((3, 3))))
    """The motion that led here."""
    seen: tuple[int, ...] = ()
    """Ids of the walls that the scan shows."""
    nis: Nis = NO_NIS
    """How far they lay from where the belief predicted them."""
    is_lost: bool = False
    """The scan fits nowhere in the map, so nobody knows where the robot is."""
    is_leap_pending: bool = False
    """It fits elsewhere in the map, and a scan from another place has to say the same."""
    fault: str = ""
    """What is wrong with the robot, in words, where the last scans say so."""

    @property
    def pose_world(self) -> Float[np.ndarray, 3]:
        """The estimated pose."""
        return self.walls.belief.pose_world
