"""From the names in a command to a world, a robot, a back end and a strategy."""

from dataclasses import dataclass, field, fields, replace
from importlib.util import find_spec
from pathlib import Path
from typing import Annotated, Literal, Protocol, runtime_checkable

import numpy as np
import shapely
from jaxtyping import Float
from msgspec import Meta, ValidationError, convert

from chainslam.explore.limits import Limits
from chainslam.explore.mission import MissionConfig
from chainslam.explore.strategies import STRATEGIES, Strategy, make_strategy
from chainslam.sim.chance import SEED_MAX, Chance, Channel
from chainslam.sim.robot import RobotConfig, SimulatedRobot, TrueRecord, chance_in
from chainslam.sim.worlds import AS_DRAWN, DrawingOptions, World, WorldError, listing, load
from chainslam.slam.association.ranges.calibrated_backend import CalibratedBackend
from chainslam.slam.association.second_looks.config import SecondLooksConfig
from chainslam.slam.backends import BACKENDS, BackendOptions
from chainslam.slam.config import MapperConfig
from chainslam.slam.estimation.backend import Backend
from chainslam.slam.estimation.mounting import start_of_scanner
from chainslam.slam.geometry.quantities import Count, Period, Place, Size, fault
from chainslam.slam.odometry.config import ScanMatchingConfig
from chainslam.slam.odometry.matched_robot import MatchedRobot
from chainslam.slam.odometry.scan_matching import ScanMatcher
from chainslam.slam.robot import Robot, fitted

from .usage import OR_OWN, UsageError, choose, did_you_mean

P0 = Literal["zero", "small", "large"]
OdometrySource = Literal["wheels", "scans"]
P0_SIGMAS: dict[str, tuple[float, float]] = {
    "zero": (1e-4, 1e-5),
    "small": (0.01, float(np.deg2rad(0.1))),
    "large": (0.1, float(np.deg2rad(2.0))),
}
"""Standard deviations of the start: position m (each axis), heading rad."""
KNOWN: P0 = "zero"
"""The start is known as well as numbers allow."""

HAS_GTSAM = find_spec("gtsam") is not None
DRIVER = "graph" if HAS_GTSAM else "invariant-ekf"
"""The back end that explores unless another is named: it loses the fewest maps of schools (`make schools`)."""
STRATEGY_OF_REPLAYS = "none"
"""Nobody decides where a recorded robot goes."""
OFFLINE = "offline"
"""In the place of a back end: a recorded drive is mapped by offline refinement alone."""


@dataclass(frozen=True)
class MappingMissionConfig(MissionConfig):
    """Settings of the mission as a whole; its parts follow."""

    mapper: MapperConfig = field(default_factory=MapperConfig)
    scan_matching: ScanMatchingConfig = field(default_factory=ScanMatchingConfig)
    """Used where `odometry` is `scans`."""
    second_looks: SecondLooksConfig = field(default_factory=SecondLooksConfig)
    """Used once the drive has ended."""


@dataclass(frozen=True)
class TrialConfig:
    """Everything that determines a trial: two trials with the same settings give identical results."""

    world: str
    """Name of a bundled world (`chainslam worlds`) or path of a drawing."""
    backend: str = "full-ekf"
    """Estimator (`chainslam backends` lists them); `explore` takes `graph` by default, or `invariant-ekf` without
    GTSAM."""
    strategy: str = "nearest-robot"
    """Strategy that chooses where to explore next (`chainslam strategies` lists them)."""
    seed: Annotated[int, Meta(ge=0)] = 1
    """Seed of all random numbers: sensor noise, wheel slip and the error of the initial pose; below 2^64."""
    p0: P0 = "small"
    """Standard deviations of the initial pose: 0.1 mm and 0.0006 degrees (zero), 1 cm and 0.1 degrees (small), 10 cm
    and 2 degrees (large)."""
    errorless: bool = False
    """Simulate ranges and odometry without noise, while the estimators still assume the stated noise."""
    max_steps: Count = 100_000
    """The run is stopped after this many scans."""
    start: Annotated[tuple[Place, ...], Meta(min_length=2, max_length=3)] | None = None
    """Start pose in place of the drawing's: x and y in m, and optionally the heading in rad."""
    drawing: DrawingOptions = field(default_factory=DrawingOptions)
    """Each is also an option of `explore` and `compare`, such as `--scale`."""
    max_path_m: Size | None = None
    """The run is stopped once the odometry has counted this path length."""
    time_limit_s: Period | None = None
    """The run is stopped after this time on the robot's own clock."""
    map: str | None = None
    """Results folder of an earlier run in the same building: the robot finds its place in that map and continues it."""
    odometry: OdometrySource = "wheels"
    """Source of the motion between two scans: wheel odometry, or scan matching that starts from it."""
    robot: RobotConfig = field(default_factory=RobotConfig)
    mission: MappingMissionConfig = field(default_factory=MappingMissionConfig)
    backend_options: BackendOptions = field(default_factory=BackendOptions)
    """Each estimator takes its own, so that one file of settings fits a comparison."""

    def __post_init__(self) -> None:
        """Let the mission know what the robot states of itself, and nothing else of it."""
        object.__setattr__(self, "mission", fitted(self.mission, self.robot.spec))

    @property
    def limits(self) -> Limits:
        """What ends the run early."""
        return Limits(self.max_steps, self.max_path_m, self.time_limit_s)


@runtime_checkable
class WitnessedRobot(Robot, Protocol):
    """A robot of which the truth is known."""

    @property
    def record(self) -> TrueRecord:
        """What really happened, up to the last scan."""
        ...


@dataclass(frozen=True)
class Scenario:
    """Everything that a trial needs, built."""

    config: TrialConfig
    world: World
    robot: WitnessedRobot
    backend: Backend
    strategy: Strategy | None
    """None where a recorded robot is ridden."""
    start_estimate: Float[np.ndarray, "3"]
    """Where the body is believed to start, world frame, m m rad."""
    start_cov: Float[np.ndarray, "3 3"]


def load_world(name: str, start: tuple[float, ...] | None = None, drawing: DrawingOptions = AS_DRAWN) -> World:
    """Return a bundled world or one from a file; raises UsageError, in one line, for anything unusable."""
    try:
        return load(name, start, drawing)
    except WorldError as error:
        is_name = not Path(name).suffix and name not in listing()
        raise UsageError(f"{error}{did_you_mean(name, listing()) if is_name else ''}") from error
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise UsageError(
            f"expected a readable world, found {Path(name).name} ({reason}): name a bundled world or a file"
        ) from error


def strategy_of(words: str) -> Strategy:
    """Return the strategy, or the schedule of several; raises UsageError for anything else."""
    try:
        return make_strategy(words)
    except ValueError as error:
        unknown = next((name for part in words.split(",") if (name := part.partition("@")[0]) not in STRATEGIES), None)
        near = did_you_mean(unknown, STRATEGIES) if unknown else ""
        raise UsageError(f"{error}{near}") from error


def check(config: TrialConfig) -> None:
    """Raise UsageError for numbers out of range and names that are in no registry, before anything is computed."""
    check_settings(config)
    if (config.backend, config.strategy) != (OFFLINE, STRATEGY_OF_REPLAYS):
        choose("back end", config.backend, BACKENDS, OR_OWN)
    _check_own(config.backend_options)
    if config.strategy != STRATEGY_OF_REPLAYS:
        strategy_of(config.strategy)


def _check_own(options: BackendOptions) -> None:
    """Raise UsageError for options of back ends of others that are in none of these, or of another kind."""
    kinds = {entry.options.__name__: entry.options for entry in BACKENDS.values() if entry.options}
    for name, said in options.own.items():
        key = f"backend_options.own.{name}"
        kind = kinds.get(name)
        if kind is None:
            raise UsageError(f"expected the class of a back end's options, found {key}: {OR_OWN}")
        known = [each.name for each in fields(kind)]
        for each in said:
            choose(f"key of {key}", each, known)
        try:
            convert(said, kind)
        except ValidationError as error:
            raise UsageError(f"expected options of {name}, found {key}: {error}") from error


def check_settings(config: TrialConfig) -> None:
    """Raise UsageError for what cannot be in any run, whatever its back end and strategy are."""
    if wrong := fault(config):
        raise UsageError(f"expected settings of a trial, found {wrong}: docs/reference/settings.md names all")
    choose("start covariance (--p0)", config.p0, P0_SIGMAS)
    if config.seed > SEED_MAX:  # a schema's numbers have 63 bits
        raise UsageError(f"expected a seed from 0 to 2^64 - 1, found {config.seed}: choose another")


def build(config: TrialConfig, world: World | None = None) -> Scenario:
    """Build a scenario; `world` saves loading it again. Raises UsageError for bad names and unusable worlds."""
    check(config)
    strategy = strategy_of(config.strategy)
    world = world or load_world(config.world, config.start, config.drawing)
    chance = None if config.errorless else chance_in(world, config.seed)
    start, cov = drawn_start(chance, world.start, config.p0)
    world = fenced(world, config)
    return Scenario(
        config,
        world,
        SimulatedRobot(world, config.seed, config.errorless, config.robot),
        make_backend(config, start, cov),
        strategy,
        start,
        cov,
    )


def sigmas_of(p0: str) -> Float[np.ndarray, "3"]:
    """Return the standard deviations (3,) m m rad of a start."""
    position_m, heading_rad = P0_SIGMAS[p0]
    return np.array([position_m, position_m, heading_rad])


def drawn_start(
    chance: Chance | None, true_start_world: Float[np.ndarray, "3"], p0: str
) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Return the pose (3,) m m rad at which the estimate starts, and its covariance (3, 3).

    It is drawn about the true one; without chance it is the true one.
    """
    sigmas = sigmas_of(p0)
    draw = np.zeros(3) if chance is None else chance.standard_normals(Channel.START, 0, 3)
    return np.asarray(true_start_world, dtype=np.float64) + sigmas * draw, np.diag(sigmas**2)


def fenced(world: World, config: TrialConfig) -> World:
    """Return the world with the mission's fence in it, for the scores; raises UsageError where it begins outside."""
    corners = config.mission.free_space.fence
    if corners is None:
        return world
    fence = shapely.Polygon(corners)
    room = fence.buffer(-config.robot.half_width_m)
    if not fence.is_valid or not shapely.contains_xy(room, *world.start[:2]):
        x, y = world.start[:2]
        raise UsageError(
            f"expected a fence around the start at ({x:.2f}, {y:.2f}) m with room for the body, found one without it:"
            " widen it, or move the start by --start"
        )
    return replace(world, fence=fence)


def make_backend(config: TrialConfig, start_world: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> Backend:
    """Return the back end of a trial for a body that is believed to start at a pose: it follows the scanner.

    It knows of errors of ranges where they are to be calibrated. Offline there is only a path, which any back end
    without walls adds up.
    """
    start, start_cov = start_of_scanner(start_world, cov, config.robot.scanner)
    name = TrialConfig.backend if config.backend == OFFLINE else config.backend
    backend = BACKENDS[name].make(start.copy(), start_cov.copy(), config.backend_options)
    return CalibratedBackend(backend) if config.robot.lidar.calibrate else backend


def heard_by(odometry: OdometrySource, robot: Robot, config: TrialConfig) -> Robot:
    """Return a robot whose motions are told by its wheels, or by its scans."""
    if odometry == "wheels":
        return robot
    return MatchedRobot(robot, ScanMatcher(config.mission.scan_matching), config.robot.scanner)
