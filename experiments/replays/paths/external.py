"""Estimators that are external programs: each follows a recorded drive and tells its pose at each scan.

docs/howto/external.md states the lines that come and go.
"""

import shlex
import shutil
from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, replace
from time import perf_counter
from typing import Any

import msgspec
import numpy as np
from jaxtyping import Float, Int

from chainslam.explore.mission import ride_mission
from chainslam.explore.step import Step
from chainslam.sim.logs.recorded_robot import MOST_M
from chainslam.slam.backends import BACKENDS, BackendEntry
from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.estimation.backend import Backend, Belief, Joint
from chainslam.slam.extraction.extract import extract
from chainslam.slam.geometry.poses import J, compose, rotation
from chainslam.slam.geometry.quantities import Period
from chainslam.slam.map_keeper import MapUpdate
from chainslam.slam.mapper import Extractor
from chainslam.slam.robot import Odometry, Robot, Scan

from ...artifacts.presets import METHODS
from ...scenario import Scenario
from ...usage import UsageError
from .looked_again import PathMapper
from .process import ExternalError, Process, running

VERSION = 1
"""Of the lines: a program may refuse another."""
UPPER = np.triu_indices(3)
SHOWN = 80
"""Characters of an answer that are shown."""
ORIGIN_M = 1e-3
"""The first pose is the frame of the others, and nearer to its origin than this, m and rad."""
OF_MAP = (
    *("lines", "lines_tentative", "lines_crooked", "lines_unlabelled", "open_ends", "set_aside", "contours_closed"),
    *("chains_closed", "chains_open", "coverage", "coverage_own_frame", "coverage_curve", "duplicate_lines"),
    *("false_matches", "false_matches_few_beams", "merges", "false_merges", "matches_true", "matches_missed"),
    *("matches_false", "certificate"),
)
"""Scores of a map."""
Three = tuple[float, float, float]
Six = tuple[float, float, float, float, float, float]


class Answer(msgspec.Struct):
    """A line of a program."""

    pose: Three
    """x m, y m, heading rad, in the frame of the first pose."""
    covariance: Six | None = None
    """xx xy xt yy yt tt of its plain error; None if it states none."""


@dataclass(frozen=True)
class ExternalConfig:
    """Settings of external programs."""

    timeout_s: Period = 60.0
    """A program that takes longer to answer a scan is ended, and its drive is lost."""


def no_map(pose_world: Float[np.ndarray, "3"], pose_cov: Float[np.ndarray, "3 3"], _: Any = None) -> Backend:
    """Return an empty map: an external program keeps its own, which nothing here reads."""
    return FullEkf(pose_world, pose_cov)


def is_external(backend: str) -> bool:
    """Return whether a back end is an external program."""
    return backend in BACKENDS and bool(BACKENDS[backend].command)


def register(given: Sequence[str], is_here: bool = True) -> tuple[tuple[str, str], ...]:
    """Register each NAME=COMMAND as a back end and return names and commands; raises UsageError.

    `is_here` says whether the programs run on this machine, so that one that is not there is refused.
    """
    found: dict[str, str] = {}
    for said in given:
        name, _, command = said.partition("=")
        try:
            words = tuple(shlex.split(command))
        except ValueError as error:
            raise UsageError(f"expected a command (--external), found {command} ({error}): correct it") from error
        if not words or not name.replace("-", "").replace("_", "").replace(".", "").isalnum() or name[0] == ".":
            raise UsageError(
                f'expected --external NAME="COMMAND", NAME of letters, digits and dashes, found {said!r}: correct it'
            )
        if is_here and shutil.which(words[0]) is None:
            raise UsageError(f"expected a program (--external {name}), found no {words[0]}: install it, or correct it")
        if name in found or name in METHODS or (name in BACKENDS and BACKENDS[name].command != words):
            raise UsageError(f"expected a new name (--external), found {name} twice: choose another")
        BACKENDS[name] = BackendEntry(no_map, f"external: {command}", ExternalConfig, carries_start=True, command=words)
        found[name] = shlex.join(words)
    return tuple(found.items())


def ride_external(
    scenario: Scenario, robot: Robot, scans: int, cut_short: str = "", unread: str = "", extractor: Extractor = extract
) -> Iterator[Step]:
    """Ask the program of a scenario for the pose at each recorded scan, and yield each step.

    The time of a step is the time until the answer. Raises ExternalError, in one line, for a program that fails.
    """
    config = scenario.config
    timeout_s = config.backend_options.of(ExternalConfig).timeout_s
    with running(BACKENDS[config.backend].command, timeout_s) as process:
        mapper = _Passenger(scenario, process, scans, extractor)
        for step in ride_mission(robot, mapper, scans, cut_short, unread):
            yield replace(step, seconds=mapper.answered_s)


class _Passenger(PathMapper):
    """Keeps no walls, and has its poses from a program."""

    def __init__(self, scenario: Scenario, process: Process, scans: int, extractor: Extractor) -> None:
        super().__init__(scenario.backend, scenario.config.mission.mapper, extractor)
        self._process, self._scans, self._scanner = process, scans, scenario.config.robot.scanner
        self._start_world, self._start_cov = scenario.start_estimate, scenario.start_cov
        self._at, self._bearings_rad = 0, np.zeros(0)
        self._heard = Odometry(np.zeros(3), np.zeros((3, 3)))
        self.answered_s = 0.0

    def predict(self, odometry: Odometry) -> None:
        """Keep the motion for the next line."""
        self._heard = odometry.reported

    def step(self, scan: Scan, set_aside: object = ()) -> MapUpdate:
        """Return the segments of a scan, the pose that the program tells, and no wall."""
        update, before = super().step(scan), f"after {self._at} of {self._scans} scans"
        line, header = msgspec.json.encode(self._line(scan)) + b"\n", b""
        if not self._at:
            header = msgspec.json.encode(self._header(scan)) + b"\n"
            self._bearings_rad = scan.bearings_rad
        try:
            began = perf_counter()
            answer = self._process.ask(line, header)
            self.answered_s = perf_counter() - began
            belief = self._belief(*_checked(answer, is_first=not self._at))
            self._at += 1
            if self._at == self._scans:
                self._process.finish()
        except ExternalError as error:
            raise ExternalError(f"{before}, {error}") from error
        return replace(update, map=replace(update.map, belief=belief))

    def _header(self, scan: Scan) -> dict[str, Any]:
        return {
            "chainslam": VERSION, "scans": self._scans, "bearings_rad": scan.bearings_rad.tolist(),
            "range_max_m": float(scan.range_max_m), "range_sigma_m": float(np.median(scan.sigma_m)),
            "scanner": self._scanner.pose_robot.tolist(),
        }  # fmt: skip

    def _line(self, scan: Scan) -> dict[str, Any]:
        is_new = self._at > 0 and not np.array_equal(scan.bearings_rad, self._bearings_rad)
        return {
            "scan": self._at, "time_s": float(scan.time_s), "motion": self._heard.motion.tolist(),
            "motion_covariance": self._heard.cov[UPPER].tolist(),
            "ranges_m": [value if np.isfinite(value) else None for value in scan.ranges_m.tolist()],
            **({"bearings_rad": scan.bearings_rad.tolist()} if is_new else {}),
            **({"carried": True} if self._heard.carried else {}),
        }  # fmt: skip

    def _belief(self, pose: Float[np.ndarray, "3"], cov: Float[np.ndarray, "3 3"]) -> Belief:
        """Return the pose in the world, with the error of the start and its own since then."""
        world = compose(self._start_world, pose)
        by_start, by_pose = np.eye(3), np.eye(3)
        by_start[:2, 2] = J @ (world[:2] - self._start_world[:2])
        by_pose[:2, :2] = rotation(float(self._start_world[2]))
        total = by_start @ self._start_cov @ by_start.T + by_pose @ cov @ by_pose.T

        def query(ids: Int[np.ndarray, " m"]) -> Joint:
            return Joint(world, total, np.zeros((len(ids), 2)))

        return Belief(world, total, np.zeros(0, dtype=np.int64), np.zeros((0, 2)), np.zeros((0, 2)), query)


def _checked(line: bytes, is_first: bool) -> tuple[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]]:
    """Return pose and covariance of an answer, NaN for one that is not stated; raises ExternalError."""
    shown = line.decode(errors="replace").strip()[:SHOWN]
    try:
        said = msgspec.json.decode(line, type=Answer)
    except (msgspec.DecodeError, UnicodeDecodeError) as error:
        raise ExternalError(f"it wrote {shown!r}, which is no pose ({error})") from error
    pose, cov = np.array(said.pose), np.full((3, 3), np.nan)
    if said.covariance is not None:
        cov[UPPER] = said.covariance
        cov.T[UPPER] = said.covariance
        is_known = is_first and not cov.any()
        if not is_known and np.linalg.eigvalsh(cov)[0] <= 0.0:
            raise ExternalError(f"it wrote {shown!r}, whose covariance is not positive definite")
    if np.abs(pose).max() > MOST_M or np.nanmax(np.abs(cov), initial=0.0) > MOST_M**2:
        raise ExternalError(f"it wrote {shown!r}, which is beyond {MOST_M:g} m")
    if is_first and np.abs(pose).max() > ORIGIN_M:
        raise ExternalError(f"it wrote {shown!r}, though the first pose is the frame of the others, (0, 0, 0)")
    return pose, cov


def without_map(summary: Mapping[str, Any]) -> dict[str, Any]:
    """Return a summary, or a row of it, without scores of a map: a program keeps none that could be scored."""
    found = dict(summary) | {name: None for name in OF_MAP if name in summary}
    if found.get("marks"):
        found["marks"] = {mark: without_map(row) for mark, row in found["marks"].items()}
    return found
