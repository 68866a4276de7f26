"""Scans kept with the walls around them, so that the grid of free floor can follow the map where the map moves."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.geometry.poses import compose, inverse, to_robot, to_world, wrap
from chainslam.slam.geometry.quantities import Count, Distance, Number, Size
from chainslam.slam.map.stochastic_map import StochasticMap
from chainslam.slam.robot import Odometry, RobotSpec, Scan, of_robot

from .free_space import FreeSpace
from .kept_scans import NO_PLACES, KeptScan, beside, told


@dataclass(frozen=True)
class FloorMemoryConfig:
    """Which scans are kept, and when the floor grid is redrawn because the map moved."""

    robot: RobotSpec = of_robot()
    spacing_m: Size = 0.25
    """Side of the squares in each of which only the latest scan is kept."""
    walls: Count = 8
    """Number of nearest walls that carry a kept scan along when they move."""
    moved_m: Distance = 0.1
    """The grid is redrawn once the floor seen by a kept scan has moved this far with its walls."""
    arm_m: Distance = 2.0
    """Distance of the floor from the scan that saw it, by which a turn of the walls becomes a displacement."""
    rest_steps: Number = 20
    """Smallest number of steps between two checks of how far the walls have moved; at least a tenth of the number of
    kept scans."""
    faith_m: Size = 0.01
    """Weight, in metres of wall, of the assumption that a kept scan moves as the one before it did."""
    redrawn: Count = 500
    """Number of kept scans that are redrawn in one step; meanwhile the old grid stays in use."""
    last_m: Size = 15.0
    """Path length whose scans are kept to begin the grid anew."""

    @property
    def last_scans(self) -> int:
        """So many of the last scans are kept to begin the grid anew."""
        return self.robot.steps_of(self.last_m)

    @property
    def touched_m(self) -> float:
        """Where the body touched something, the way that it drove is closed this far around: half its radius."""
        return 0.5 * self.robot.radius_m

    @property
    def step_m(self) -> float:
        """Two poses of one step no farther apart are joined by a way that the robot drove; else the map jumped."""
        return 2.0 * self.robot.step_m


@dataclass
class _Redrawing:
    """A grid that is drawn anew beside the one in use, some scans a step."""

    grid: FreeSpace
    left: list[KeptScan]
    """What was not drawn yet, the first at the end."""
    late: list[tuple[Float[np.ndarray, "3"], Scan, Float[np.ndarray, "n 2"]]]
    """Scans taken since it began, each with its pose and the way there, world frame."""


class FloorMemory:
    """Draws every scan into a grid, keeps some, and draws those anew when the walls around them have moved.

    No filter keeps past poses, but each keeps the walls: a kept scan goes where the nearest walls went, by the turn and
    the shift that fit best, in least squares by length of wall. The way that the robot drove goes with the scans.
    """

    def __init__(self, free_space: FreeSpace, config: FloorMemoryConfig = FloorMemoryConfig()) -> None:
        self.free_space, self._config = free_space, config
        self._kept: dict[tuple[int, ...], KeptScan] = {}
        self._redrawing: _Redrawing | None = None
        self._rested = 0
        self._last: deque[tuple[Float[np.ndarray, 3], Scan]] = deque(maxlen=config.last_scans)
        self._odometry = np.zeros(3)
        self._before_world: Float[np.ndarray, 2] | None = None
        self._expected_world: Float[np.ndarray, 3] | None = None

    def move(self, odometry: Odometry) -> None:
        """Take note that the robot has moved."""
        if self._expected_world is not None:
            self._expected_world = compose(self._expected_world, odometry.motion)
        self._odometry = compose(self._odometry, odometry.motion)

    def _last_robot(self) -> Float[np.ndarray, "k 3"]:
        """Return where the odometry says that the last scans were taken, from the robot of now, the last at the end."""
        back = inverse(self._odometry)
        return np.array([compose(back, pose) for pose, _ in self._last]).reshape(-1, 3)

    def last_way_world(self, pose_world: Float[np.ndarray, "3"], length_m: float) -> Float[np.ndarray, "w 2"]:
        """Return where the odometry says that the robot drove last, m, if it now is at a pose: the last place first."""
        way = to_world(self._last_robot()[::-1, :2], pose_world)
        along = np.cumsum(np.hypot(*np.diff(way, axis=0, prepend=pose_world[None, :2]).T))
        return way[along <= length_m]

    def see(self, walls: StochasticMap, scan: Scan) -> None:
        """Take in one scan at the pose that the map believes in."""
        pose = walls.belief.pose_world
        self._last.append((self._odometry, scan))
        self._rested += 1
        jumped = self._has_jumped(pose)
        self._expected_world = pose.copy()
        self._go_on(self._config.redrawn)
        is_due = self._redrawing is None and self._rested >= max(self._config.rest_steps, len(self._kept) // 10)
        if jumped or is_due:
            self._rested = 0
            self._follow(walls)
        self._take_in(walls, walls.distances_m, pose, scan)

    def _has_jumped(self, pose_world: Float[np.ndarray, "3"]) -> bool:
        """Return whether the robot is not where the odometry has led it: the walls may have moved with it."""
        if self._expected_world is None:
            return False
        moved = np.hypot(*(pose_world - self._expected_world)[:2])
        turned = abs(wrap(pose_world[2] - self._expected_world[2]))
        return bool(moved + self._config.arm_m * turned > self._config.moved_m)

    def note_touched(self, pose_world: Float[np.ndarray, "3"], places_robot: Float[np.ndarray, "t 2"]) -> None:
        """Remember that the body, at the pose of the last scan, touched something, and that it does not fit there."""
        self._go_on(len(self._kept))
        for place in to_world(places_robot, pose_world):
            self.free_space.note_touched(place)
        self.free_space.note_too_tight(pose_world[:2])
        self.free_space.forget_driven(pose_world[:2], self._config.touched_m)
        key = next(reversed(self._kept))
        view = self._kept[key]
        self._kept[key] = replace(view, touched_robot=np.vstack([view.touched_robot, places_robot]))

    def way_world(self) -> Float[np.ndarray, "w 2"]:
        """Return where the robot drove, as the map has it now, m."""
        return np.concatenate([to_world(view.way_robot, view.pose_world) for view in self._kept.values()])

    def begin_anew(self, walls: StochasticMap) -> None:
        """Forget all but the last scans, and draw those where the odometry says that they were taken, seen from now."""
        self.free_space.become(self.free_space.blank())
        self._redrawing = None
        self._kept.clear()
        self._before_world, self._rested = None, 0
        here = walls.belief.pose_world
        poses = [compose(here, pose) for pose in self._last_robot()]
        distances = distance_to_segments(np.array([pose[:2] for pose in poses]), walls.ends_world)
        for pose, (_, scan), away in zip(poses, self._last, distances, strict=True):
            self._take_in(walls, away, pose, scan)

    def _take_in(
        self, walls: StochasticMap, distances_m: Float[np.ndarray, " n"], pose: Float[np.ndarray, "3"], scan: Scan
    ) -> None:
        """Draw one scan taken at a pose, note the way there, and keep it in place of an older one from nearby."""
        self.free_space.integrate(pose, scan)
        way_world = _between(self._before_world, pose[:2], self._config.step_m, 0.5 * self.free_space.config.cell_m)
        self.free_space.note_driven(way_world)
        self._before_world = pose[:2].copy()
        key = tuple(np.floor(pose[:2] / self._config.spacing_m).astype(int).tolist())
        if not scan.is_full_turn:
            key = *key, int(pose[2] // (0.25 * np.pi))
        old = self._kept.pop(key, None)  # the newest stands last
        driven_world, touched_world = way_world, NO_PLACES
        if old is not None:
            touched_world = to_world(old.touched_robot, old.pose_world)
            driven_world = np.vstack([to_world(old.way_robot, old.pose_world), way_world])
            driven_world = np.array(sorted(set(map(tuple, np.round(driven_world, 2).tolist()))))
        if self._redrawing is not None:
            self._redrawing.late.append((pose, scan, way_world))
        view = beside(walls, pose[None], [scan], self._config.walls, distances_m[None])[0]
        self._kept[key] = replace(
            view, way_robot=to_robot(driven_world, pose), touched_robot=to_robot(touched_world, pose)
        )

    def _follow(self, walls: StochasticMap) -> None:
        """Begin to draw the grid anew if the walls have carried a kept scan away from where it was drawn."""
        kept = list(self._kept.values())
        what = told(walls, kept)
        motions = what.motions(self._config.faith_m)
        moved = np.hypot(motions[:, 0], motions[:, 1]) + self._config.arm_m * np.abs(motions[:, 2])
        if not np.any(moved > self._config.moved_m):
            return
        poses = what.carried(np.array([view.pose_world for view in kept]), self._config.faith_m)
        now = beside(walls, poses, [view.scan for view in kept], self._config.walls)
        for key, view, new in zip(list(self._kept), kept, now, strict=True):
            self._kept[key] = replace(new, way_robot=view.way_robot, touched_robot=view.touched_robot)
        self._redrawing = _Redrawing(self.free_space.blank(), list(self._kept.values())[::-1], [])
        self._go_on(self._config.redrawn)

    def _go_on(self, scans: int) -> None:
        """Draw some more of the kept scans into the new grid, and take it into use once it has them all."""
        new = self._redrawing
        if new is None:
            return
        views = new.left[-scans:][::-1]
        del new.left[-scans:]
        for view in views:
            new.grid.integrate(view.pose_world, view.scan)
        new.grid.note_driven(np.concatenate([to_world(view.way_robot, view.pose_world) for view in views]))
        for view in views:
            for place in to_world(view.touched_robot, view.pose_world):
                new.grid.note_touched(place)
        if not new.left:
            for pose, scan, way_world in new.late:
                new.grid.integrate(pose, scan)
                new.grid.note_driven(way_world)
            self.free_space.become(new.grid)
            self._redrawing = None


def _between(
    before_world: Float[np.ndarray, "2"] | None, now_world: Float[np.ndarray, "2"], most_m: float, every_m: float
) -> Float[np.ndarray, "n 2"]:
    """Return places on the straight way from one place to the next; the next alone where they lie too far apart."""
    length_m = np.inf if before_world is None else float(np.hypot(*(now_world - before_world)))
    if before_world is None or length_m > most_m:
        return now_world[None].copy()
    share = np.linspace(0.0, 1.0, int(np.ceil(length_m / every_m)) + 1)[:, None]
    return before_world + share * (now_world - before_world)
