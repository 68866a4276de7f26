"""Scans kept with the walls around them, so that the grid of free floor can follow the map where the map moves."""

from collections import deque
from dataclasses import dataclass, replace

import numpy as np
from jaxtyping import Float, Int

from slam.geometry.lines import distance_to_segments, normals
from slam.geometry.poses import compose, inverse, rotation, to_robot, to_world, wrap
from slam.map.stochastic_map import StochasticMap
from slam.robot import Odometry, RobotSpec, Scan, of_robot

from .free_space import FreeSpace


@dataclass(frozen=True)
class FloorMemoryConfig:
    """Which scans are kept, and when the grid is drawn anew."""

    robot: RobotSpec = of_robot()
    spacing_m: float = 0.25
    """Of the scans taken in one square of this side the last one is kept."""
    walls: int = 8
    """So many of the nearest walls carry a kept scan with them."""
    moved_m: float = 0.1
    """The grid is drawn anew once floor seen from a kept scan has moved this far with its walls."""
    arm_m: float = 2.0
    """How far that floor lies from the scan, for what a turn of the walls moves."""
    rest_steps: int = 20
    """So many steps at least, and a tenth of the scans kept, lie between two looks at how far the walls have moved."""
    faith_m: float = 0.01
    """Where no wall nearby tells, a scan moves as the one kept before it did: worth this many metres of wall."""
    last_m: float = 15.0
    """The last scans, of the steps that so long a way takes, are enough to begin the grid anew."""

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


@dataclass(frozen=True)
class _Kept:
    """A scan with the nearest walls as they stood around it; `ids` is padded with -1."""

    pose_world: Float[np.ndarray, "3"]
    scan: Scan
    ids: Int[np.ndarray, " w"]
    alphas: Float[np.ndarray, " w"]
    offsets: Float[np.ndarray, " w"]
    """From the pose to each line along its normal, m."""
    way_robot: Float[np.ndarray, "d 2"]
    """Where the robot drove while the scans of this place were taken, in the frame of this one, m."""
    touched_robot: Float[np.ndarray, "t 2"]
    """What its body touched then."""


@dataclass(frozen=True)
class _Told:
    """What the walls tell of the motion of each of k scans, as sums by length of wall."""

    length_m: Float[np.ndarray, " k"]
    turn: Float[np.ndarray, " k"]
    normal: Float[np.ndarray, "k 2 2"]
    shift: Float[np.ndarray, "k 2"]

    def motions(self, faith_m: float) -> Float[np.ndarray, "k 3"]:
        """Return (x, y, turn) of each scan by itself, world frame: none where no wall tells."""
        turn = self.turn / (self.length_m + faith_m)
        shift = np.linalg.solve(self.normal + faith_m * np.eye(2), self.shift[..., None])[..., 0]
        return np.column_stack([shift, turn])


class FloorMemory:
    """Draws every scan into a grid, keeps some, and draws those anew when the walls around them have moved.

    No filter keeps past poses, but each keeps the walls: a kept scan goes where the nearest walls went, by the turn and
    the shift that fit best, in least squares by length of wall. The way that the robot drove goes with the scans.
    """

    def __init__(self, free_space: FreeSpace, config: FloorMemoryConfig = FloorMemoryConfig()) -> None:
        self.free_space, self._config = free_space, config
        self._kept: dict[tuple[int, ...], _Kept] = {}
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
        if jumped or self._rested >= max(self._config.rest_steps, len(self._kept) // 10):
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
        self.free_space.clear()
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
        touched_world = np.zeros((0, 2))
        if old is not None:
            touched_world = to_world(old.touched_robot, old.pose_world)
            way_world = np.unique(np.round(np.vstack([to_world(old.way_robot, old.pose_world), way_world]), 2), axis=0)
        view = self._beside(walls, distances_m, pose, scan)
        self._kept[key] = replace(
            view, way_robot=to_robot(way_world, pose), touched_robot=to_robot(touched_world, pose)
        )

    def _beside(
        self, walls: StochasticMap, distances_m: Float[np.ndarray, " n"], pose_world: Float[np.ndarray, "3"], scan: Scan
    ) -> _Kept:
        """Return a scan to keep, with the walls nearest to its pose."""
        rows = np.argsort(np.where(walls.tentative, np.inf, distances_m), kind="stable")[: self._config.walls]
        rows = rows[~walls.tentative[rows]]
        ids, lines = np.full(self._config.walls, -1), np.zeros((self._config.walls, 2))
        ids[: len(rows)], lines[: len(rows)] = walls.ids[rows], walls.belief.lines_world[rows]
        return _Kept(
            pose_world,
            scan,
            ids,
            lines[:, 0],
            lines[:, 1] - normals(lines[:, 0]) @ pose_world[:2],
            *np.zeros((2, 0, 2)),
        )

    def _follow(self, walls: StochasticMap) -> None:
        """Draw the grid anew if the walls have carried a kept scan away from where it was drawn."""
        kept = list(self._kept.values())
        told = _told(walls, kept)
        motions = told.motions(self._config.faith_m)
        moved = np.hypot(motions[:, 0], motions[:, 1]) + self._config.arm_m * np.abs(motions[:, 2])
        if not np.any(moved > self._config.moved_m):
            return
        poses = _carried(np.array([view.pose_world for view in kept]), told, self._config.faith_m)
        distances = distance_to_segments(poses[:, :2], walls.ends_world)
        self.free_space.clear()
        for key, view, pose, away in zip(list(self._kept), kept, poses, distances, strict=True):
            self.free_space.integrate(pose, view.scan)
            self.free_space.note_driven(to_world(view.way_robot, pose))
            for place in to_world(view.touched_robot, pose):
                self.free_space.note_touched(place)
            moved = self._beside(walls, away, pose, view.scan)
            self._kept[key] = replace(moved, way_robot=view.way_robot, touched_robot=view.touched_robot)


def _between(
    before_world: Float[np.ndarray, "2"] | None, now_world: Float[np.ndarray, "2"], most_m: float, every_m: float
) -> Float[np.ndarray, "n 2"]:
    """Return places on the straight way from one place to the next; the next alone where they lie too far apart."""
    length_m = np.inf if before_world is None else float(np.hypot(*(now_world - before_world)))
    if before_world is None or length_m > most_m:
        return now_world[None].copy()
    share = np.linspace(0.0, 1.0, int(np.ceil(length_m / every_m)) + 1)[:, None]
    return before_world + share * (now_world - before_world)


def _told(walls: StochasticMap, kept: list[_Kept]) -> _Told:
    """Return what the walls, as they stand now, tell of the motion of scans that were kept beside them."""
    ids = np.array([view.ids for view in kept])
    places = np.array([view.pose_world[:2] for view in kept])
    rows = np.minimum(np.searchsorted(walls.ids, ids), max(len(walls) - 1, 0))
    if not len(walls):
        nothing = np.zeros(len(kept))
        return _Told(nothing, nothing, np.zeros((len(kept), 2, 2)), np.zeros((len(kept), 2)))
    lines, extents = walls.belief.lines_world[rows], walls.extents[rows]
    length = np.where(walls.ids[rows] == ids, extents[..., 1] - extents[..., 0], 0.0)
    n = normals(lines[..., 0])
    offsets = lines[..., 1] - np.vecdot(n, places[:, None])
    turns = wrap(lines[..., 0] - np.array([view.alphas for view in kept]))
    away = offsets - np.array([view.offsets for view in kept])
    return _Told(
        length.sum(axis=1),
        np.vecdot(length, turns),
        np.einsum("kw,kwi,kwj->kij", length, n, n),
        np.einsum("kw,kwi,kw->ki", length, n, away),
    )


def _carried(poses_world: Float[np.ndarray, "k 3"], told: _Told, faith_m: float) -> Float[np.ndarray, "k 3"]:
    """Return where the walls carried scans; where they do not tell, a scan moved as one with that before it."""
    motion, there = np.zeros(3), poses_world[0, :2]
    carried = np.empty_like(poses_world)
    for k, pose in enumerate(poses_world):
        arm = pose[:2] - there
        shift = motion[:2] + rotation(motion[2]) @ arm - arm
        turn = (told.turn[k] + faith_m * motion[2]) / (told.length_m[k] + faith_m)
        shift = np.linalg.solve(told.normal[k] + faith_m * np.eye(2), told.shift[k] + faith_m * shift)
        motion, there = np.array([*shift, turn]), pose[:2]
        carried[k] = *(pose[:2] + shift), wrap(pose[2] + turn)
    return carried
