"""The grid of free floor as scans come in, and the last scans, with which it can begin anew."""

from collections import deque
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import compose, inverse, to_world
from chainslam.slam.geometry.quantities import Size
from chainslam.slam.robot import Odometry, RobotSpec, Scan, of_robot

from .free_space import FreeSpace


@dataclass(frozen=True)
class FloorMemoryConfig:
    """How much is kept of what was seen last."""

    robot: RobotSpec = of_robot()
    last_m: Size = 15.0
    """Path length whose scans are kept to begin the grid anew."""

    @property
    def last_scans(self) -> int:
        """So many of the last scans are kept to begin the grid anew."""
        return self.robot.steps_of(self.last_m)


class FloorMemory:
    """Draws every scan into a grid at the pose that the map believes in, and keeps the last ones by odometry."""

    def __init__(self, free_space: FreeSpace, config: FloorMemoryConfig = FloorMemoryConfig()) -> None:
        self.free_space = free_space
        self._last: deque[tuple[Float[np.ndarray, 3], Scan]] = deque(maxlen=config.last_scans)
        self._odometry = np.zeros(3)
        self._way_world: list[Float[np.ndarray, 2]] = []

    def move(self, odometry: Odometry) -> None:
        """Take note that the robot has moved."""
        self._odometry = compose(self._odometry, odometry.motion)

    def see(self, pose_world: Float[np.ndarray, "3"], scan: Scan) -> None:
        """Take in one scan at the pose that the map believes in."""
        self._last.append((self._odometry, scan))
        self._take_in(pose_world, scan)

    def _take_in(self, pose_world: Float[np.ndarray, "3"], scan: Scan) -> None:
        self.free_space.integrate(pose_world, scan)
        self._way_world.append(pose_world[:2].copy())

    def way_world(self) -> Float[np.ndarray, "w 2"]:
        """Return where the scans of the grid were taken, m."""
        return np.array(self._way_world)

    def last_way_world(self, pose_world: Float[np.ndarray, "3"], length_m: float) -> Float[np.ndarray, "w 2"]:
        """Return where the odometry says that the robot drove last, m, if it now is at a pose: the last place first."""
        way = to_world(self._last_robot()[::-1, :2], pose_world)
        along = np.cumsum(np.hypot(*np.diff(way, axis=0, prepend=pose_world[None, :2]).T))
        return way[along <= length_m]

    def begin_anew(self, pose_world: Float[np.ndarray, "3"]) -> None:
        """Forget all but the last scans, and draw those where the odometry says that they were taken, seen from now."""
        self.free_space.clear()
        self._way_world.clear()
        for pose, (_, scan) in zip(self._last_robot(), self._last, strict=True):
            self._take_in(compose(pose_world, pose), scan)

    def _last_robot(self) -> Float[np.ndarray, "k 3"]:
        """Return where the odometry says that the last scans were taken, from the robot of now, the last at the end."""
        back = inverse(self._odometry)
        return np.array([compose(back, pose) for pose, _ in self._last]).reshape(-1, 3)
