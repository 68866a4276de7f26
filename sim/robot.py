"""The simulated robot: it knows the truth, and passes only what `slam.robot` defines to the software."""

from dataclasses import dataclass, field, fields, replace
from typing import Protocol, runtime_checkable

import numpy as np
import shapely
from jaxtyping import Bool, Float, Int

from chainslam.slam.geometry.lines import distance_to_segments
from chainslam.slam.geometry.poses import compose, to_world
from chainslam.slam.geometry.quantities import Period, Pitch, Speed
from chainslam.slam.robot import LidarSpec, MotionCommand, Odometry, RobotSpec, Scan, ScannerSpec

from .chance import Chance, Channel, world_key
from .drive import clamp, draw_slip, odometry, seconds, true_motion
from .faults import (
    NEVER,
    FaultsConfig,
    bump_rad,
    is_moving,
    misread,
    places_of_beams,
    slipped,
    with_dropouts,
    with_mixed_pixels,
    with_posts,
)
from .kernels import clear_places
from .lidar import LidarConfig, RangeFinder, beam_sigmas, noisy
from .people import People, hidden_by

_CELL_M = 0.5
"""Side of the grid cells that share one list of faces within a step's reach."""


@runtime_checkable
class Building(Protocol):
    """The properties of a world that the robot needs."""

    @property
    def faces(self) -> Float[np.ndarray, "n 2 2"]:
        """The true faces, world frame, m, each with its free side on the left."""
        ...

    @property
    def start(self) -> Float[np.ndarray, "3"]:
        """Start pose, m m rad."""
        ...


def chance_in(world: Building, seed: int) -> Chance:
    """Return the random streams of a robot in a world, and of the error of its initial estimate, for a seed."""
    return Chance(seed, world_key(world.faces, world.start))


@dataclass(frozen=True)
class RobotConfig(RobotSpec):
    """The simulated robot: what it states about itself, and what only the simulation knows."""

    sampling_m: Pitch = 0.005
    """Distance between the points of a step at which collisions are checked."""
    scan_s: Period = 0.1
    """Time that one revolution of the scanner takes."""
    lidar: LidarConfig = field(default_factory=LidarConfig)
    wheel_speed_m_s: Speed = 0.3
    """Speed of the faster wheel, which determines how long a step takes."""
    faults: FaultsConfig = field(default_factory=FaultsConfig)

    @property
    def true_scanner(self) -> ScannerSpec:
        """The true place of the scanner."""
        stated, faults = self.scanner, self.faults
        return ScannerSpec(
            stated.x_m + faults.scanner_ahead_m,
            stated.y_m + faults.scanner_left_m,
            stated.heading_rad + faults.scanner_turned_rad,
        )

    @property
    def spec(self) -> RobotSpec:
        """What the robot states, without its simulation."""
        stated = {each.name: getattr(self, each.name) for each in fields(RobotSpec)}
        return RobotSpec(**stated | {"lidar": LidarSpec(calibrate=self.lidar.calibrate)})

    def stating(self, spec: RobotSpec) -> "RobotConfig":
        """Return a robot with these devices and the statements of another."""
        stated = {each.name: getattr(spec, each.name) for each in fields(RobotSpec)}
        return replace(self, **stated | {"lidar": replace(self.lidar, calibrate=spec.lidar.calibrate)})


@dataclass
class TrueRecord:
    """The truth at each step; only `experiments/` reads it."""

    poses_world: list[Float[np.ndarray, "3"]] = field(default_factory=list)
    """The true pose at each scan."""
    faces_of_beams: list[Int[np.ndarray, " k"]] = field(default_factory=list)
    """The face that each beam of each scan hits; -1 for none."""
    collisions: int = 0
    drive_time_s: float = 0.0
    path_length_m: float = 0.0
    """Length of the true path."""


class SimulatedRobot:
    """A robot with a range finder and slipping wheels in a drawn building."""

    def __init__(self, world: Building, seed: int, errorless: bool = False, config: RobotConfig | None = None) -> None:
        """Start in `world`; `errorless` removes the noise of ranges and odometry but not the stated noise."""
        self.config = config or RobotConfig()
        self._record = TrueRecord()
        self._errorless = errorless
        self._chance = chance_in(world, seed)
        self._finder, self._scanner = RangeFinder(world.faces, self.config.lidar), self.config.true_scanner
        self._faces = np.asarray(world.faces, dtype=np.float64)
        self._near: dict[tuple[int, int], Float[np.ndarray, "m 2 2"]] = {}
        self._pose = np.array(world.start, dtype=np.float64)
        self._people = People(self.config.faults.people, self._faces, self._chance, self.config.radius_m)
        self._people.enter(self._pose[:2], self.config.lidar.range_max_m)
        self._told: list[tuple[Float[np.ndarray, " k"], Int[np.ndarray, " k"]]] = []
        self._time_s, self._drives = 0.0, 0
        self._way, self._drive_s = np.zeros((0, 3)), 0.0

    @property
    def record(self) -> TrueRecord:
        """The truth up to the last scan."""
        return self._record

    @property
    def true_pose(self) -> Float[np.ndarray, "3"]:
        """The true pose, world frame, m m rad."""
        return self._pose.copy()

    def sense(self) -> Scan:
        """Return the scan at the present pose and record the truth about it."""
        lidar, faults, step = self.config.lidar, self.config.faults, len(self._record.poses_world)
        ranges, faces = self._cast(len(self._way) > 0 and is_moving(faults, self._chance, step))
        ranges, mixed = with_mixed_pixels(ranges, faults, lidar.is_full_turn, self._chance, step)
        if not self._errorless:
            draws = self._chance.standard_normals(Channel.LASER, step, len(ranges))
            ranges = noisy(ranges, beam_sigmas(ranges, lidar), draws, lidar.range_max_m)
        ranges = misread(ranges, faults, lidar.range_max_m, lidar.resolution_m)
        ranges = with_dropouts(ranges, faults, self._chance, step)
        ranges, faces = self._as_told(ranges, np.where(np.isfinite(ranges) & ~mixed, faces, -1), step)
        self._record.poses_world.append(self._pose.copy())
        self._record.faces_of_beams.append(faces.astype(np.min_scalar_type(-len(self._faces) - 1)))
        start_s, self._time_s = self._time_s, self._time_s + self.config.scan_s
        return Scan(
            self._finder.bearings_rad,
            ranges,
            lidar.sigma_m,
            lidar.range_max_m,
            self._time_s,
            lidar.sigma_share,
            start_s,
            lidar.resolution_m,
        )

    def _as_told(
        self, ranges: Float[np.ndarray, " k"], faces: Int[np.ndarray, " k"], step: int
    ) -> tuple[Float[np.ndarray, " k"], Int[np.ndarray, " k"]]:
        """Return the ranges with the scanner's faults (late, frozen or mirrored), and their faces."""
        faults = self.config.faults
        if faults.late or faults.frozen_from != NEVER:
            self._told.append((ranges, faces))
            ranges, faces = self._told[max(min(step, faults.frozen_from - 1) - faults.late, 0)]
        if not faults.mirrored:
            return ranges, faces
        # On a full turn bearing -pi has no counterpart at +pi: it stays in place.
        back = -np.arange(len(ranges)) if self.config.lidar.is_full_turn else -1 - np.arange(len(ranges))
        return ranges[back], faces[back]

    def _cast(self, moving: bool) -> tuple[Float[np.ndarray, " k"], Int[np.ndarray, " k"]]:
        """Return exact ranges m and faces of the beams; in a scan taken in motion, each from the pose at its time."""
        scanner = self._scanner
        if not moving:
            at = self._pose if scanner.is_at_axle else compose(self._pose, scanner.pose_robot)
            return self._seen_from(at)
        places = places_of_beams(self._way, self._drive_s, self.config.scan_s)
        casts = [self._seen_from(compose(compose(self._pose, place), scanner.pose_robot)) for place in places]
        taken = np.arange(self.config.lidar.beams) * len(casts) // self.config.lidar.beams
        beams = np.arange(self.config.lidar.beams)
        return np.array([each[0] for each in casts])[taken, beams], np.array([each[1] for each in casts])[taken, beams]

    def _seen_from(
        self, scanner_world: Float[np.ndarray, "3"]
    ) -> tuple[Float[np.ndarray, " k"], Int[np.ndarray, " k"]]:
        """Return exact ranges m and faces of the beams; no face if a person or a post of the robot is hit first."""
        ranges, faces = self._finder.cast(scanner_world)
        faults, bearings = self.config.faults, self._finder.bearings_rad
        people = self._people.places_at(self._time_s)
        seen = hidden_by(ranges, bearings + scanner_world[2], scanner_world[:2], people, faults.people.radius_m)
        seen = with_posts(seen, bearings, faults)
        return seen, faces if seen is ranges else np.where(seen < ranges, -1, faces)

    def drive(self, command: MotionCommand) -> Odometry:
        """Carry out one command, shortened to the longest step (`clamp`), and return what the wheels report.

        Where the body would touch a wall the robot stops at the last free place of its way, the collision is
        counted, the wheels report the part that was driven, and the bumper that it touched.
        """
        drive = self.config.wheels
        command = clamp(command, self.config)
        draws = np.zeros(3) if self._errorless else self._chance.standard_normals(Channel.WHEELS, self._drives, 3)
        slip = slipped(draw_slip(command, drive, draws), self.config.faults)
        count = 1 + int(np.ceil((abs(command.forward_m) + abs(slip.lateral_m)) / self.config.sampling_m))
        shares = np.linspace(0.0, 1.0, count + 1)[1:]
        motions = true_motion(command, slip, drive, shares)
        free = self._free_places(to_world(motions[:, :2], self._pose), motions[:, 2] + self._pose[2])
        touched = free < count
        if touched:
            self._record.collisions += 1
            share = float(shares[free - 1]) if free else 0.0
            command = MotionCommand(share * command.forward_m, share * command.turn_rad)
        is_stuck = self._drives >= self.config.faults.stuck_from
        if free and not is_stuck:
            self._pose = compose(self._pose, motions[free - 1])
            self._record.path_length_m += float(np.hypot(*motions[free - 1, :2]))
        self._pose[2] += bump_rad(self.config.faults, self._chance, self._drives)
        self._drives += 1
        duration = seconds(command, drive, self.config.wheel_speed_m_s)
        self._time_s += duration
        self._people.walk(duration + self.config.scan_s, self._pose[:2])
        self._way, self._drive_s = np.zeros((0, 3)) if is_stuck else motions[:free], duration
        self._record.drive_time_s += duration
        reported = odometry(command, drive)
        return replace(reported, touched=True) if touched else reported

    def _free_places(self, places_world: Float[np.ndarray, "n 2"], headings_rad: Float[np.ndarray, " n"]) -> int:
        """Return the number of poses, from the first on, at which the body is clear of every face and person."""
        near, people = self._faces_near(places_world[0]), self._people.places_at(self._time_s)
        if self.config.outline_m is not None:
            touched = self._touched(np.column_stack([places_world, headings_rad]), near, people)
            return int(np.argmax(touched)) if touched.any() else len(places_world)
        return clear_places(places_world, near, self.config.radius_m, people, self.config.faults.people.radius_m)

    def _touched(
        self,
        poses_world: Float[np.ndarray, "n 3"],
        faces: Float[np.ndarray, "m 2 2"],
        people: Float[np.ndarray, "p 2"],
    ) -> Bool[np.ndarray, " n"]:
        """Return at which poses a body with an outline touches a face or a person."""
        corners = np.array([to_world(np.array(self.config.outline_m), pose) for pose in poses_world])
        bodies = shapely.polygons(corners)
        touched = shapely.intersects(bodies, shapely.multilinestrings(faces))
        if len(people):
            gaps = shapely.distance(np.asarray(bodies)[:, None], shapely.points(people)).min(axis=1)
            touched |= gaps < self.config.faults.people.radius_m
        return np.asarray(touched)

    def _faces_near(self, place_world: Float[np.ndarray, "2"]) -> Float[np.ndarray, "m 2 2"]:
        """Return the faces that one step from anywhere in the grid cell of `place_world` may touch."""
        cell = (int(place_world[0] // _CELL_M), int(place_world[1] // _CELL_M))
        if cell not in self._near:
            centre = (np.array([cell]) + 0.5) * _CELL_M
            # A slipping step may be a little longer than the longest command.
            reach = np.sqrt(0.5) * _CELL_M + 2.0 * self.config.step_m + self.config.radius_m
            self._near[cell] = self._faces[distance_to_segments(centre, self._faces)[0] <= reach]
        return self._near[cell]
