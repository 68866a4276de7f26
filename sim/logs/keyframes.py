"""Selection of the scans of a log that are mapped: one whenever the odometry has moved far enough since the last."""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.poses import compose, inverse, wrap
from chainslam.slam.geometry.quantities import Count, Deviation, Size, Spread, Turn, Weight

from .archive import LIMIT_BYTES
from .raw_scan import ClockError, LeftOut, LogError, RawScan, scanner_on_robot
from .recorded_robot import Recording, differing, fan_of, padded
from .units import Measures

FIRST_M, FIRST_SCANS = 2.0, 300
"""The scanner's place on the robot is estimated from the first scans: this many, or this many metres."""


@dataclass(frozen=True)
class KeyframesConfig:
    """Which scans are mapped, and how far the wheels are believed between two of them.

    The same for all logs: medians of real wheels' errors between two keyframes are 1 to 4 degrees, slips of 13 occur.
    """

    least_m: Size = 0.1
    """A scan is mapped if the robot has moved this far since the last one, or turned by `least_rad`."""
    least_rad: Turn = float(np.deg2rad(5.0))
    every: Count = 1
    """Only every n-th of these."""
    sigma_m: Deviation = 0.02
    """Assumed range noise: logs do not state it, and scans of real walls scatter more than the scanner does."""
    wheels_m: Deviation = 0.02
    """Standard deviation of the odometry between two keyframes, plus `wheels_share` of the distance."""
    wheels_share: Weight = 0.1
    wheels_rad: Spread = float(np.deg2rad(3.0))
    """The same for the turn, plus `turn_share` of the turn."""
    turn_share: Weight = 0.15


@dataclass(frozen=True)
class RecordedLog:
    """A log as it is mapped: s keyframes out of n scans."""

    recording: Recording
    """Recording of the scanner: odometry and poses are those of the scanner, not of the middle of the robot."""
    scan_time_s: Float[np.ndarray, " n"]
    """Times of all scans, on the log's own clock."""
    keyframe_of_scan: Int[np.ndarray, " n"]
    """The last keyframe at or before each scan."""
    motion_since: Float[np.ndarray, "n 3"]
    """Odometry from that keyframe to the scan, m m rad."""
    share_since: Float[np.ndarray, " n"]
    """Share of the odometry from that keyframe to the next one, turns counted as in `KeyframesConfig`; 0 to 1."""
    scanner_on_robot: Float[np.ndarray, "3"]
    """The scanner's pose on the robot, m m rad."""
    trouble: str = ""
    """Why the log ends early, in words with the position in the file."""
    notes: tuple[str, ...] = ()
    """Assumptions that were made about the log, in words."""
    left_out: LeftOut = field(default_factory=LeftOut)
    """Scans that could not be read, or whose time goes back."""

    def poses_of_scans(self, keyframes_world: Float[np.ndarray, "s 3"]) -> Float[np.ndarray, "n 3"]:
        """Return the poses of all scans, given those of the keyframes; `s` may be smaller if a run ended early.

        Scans after the last given keyframe are left out.
        """
        of = self.keyframe_of_scan[self.keyframe_of_scan < len(keyframes_world)]
        return _moved(keyframes_world[of], self.motion_since[: len(of)])

    def smoothed_poses_of_scans(self, keyframes_world: Float[np.ndarray, "s 3"]) -> Float[np.ndarray, "n 3"]:
        """Return the same where each keyframe is known by what came after it: so are the scans before it then.

        What the wheels were wrong by from one keyframe to the next they were wrong by evenly along their way.
        """
        of = self.keyframe_of_scan[self.keyframe_of_scan < len(keyframes_world)]
        found = [compose(inverse(a), b) for a, b in pairwise(keyframes_world)]
        off = np.array([*found, np.zeros(3)]).reshape(-1, 3)
        off[:-1] -= self.recording.odometry[1 : len(keyframes_world)]
        off[:, 2] = wrap(off[:, 2])
        since = self.motion_since[: len(of)] + self.share_since[: len(of), None] * off[of]
        return _moved(keyframes_world[of], since)


def _moved(poses: Float[np.ndarray, "n 3"], motions: Float[np.ndarray, "n 3"]) -> Float[np.ndarray, "n 3"]:
    """Return each pose followed by its motion."""
    return np.array([compose(pose, motion) for pose, motion in zip(poses, motions, strict=True)]).reshape(-1, 3)


def gather(scans: Iterator[RawScan | LogError], config: KeyframesConfig, notes: list[str] | None = None) -> RecordedLog:
    """Read all scans and return the log; raises LogError if not one of them can be used.

    Unusable scans are left out, `trouble` says why no more were read, and `notes` lists the assumptions. Raises
    LogError as well if the numbers cannot be metres, radians and seconds.
    """
    found, measures, trouble, broken = _Gathered(config), Measures(), "", list[str]()
    try:
        for scan in scans:
            if isinstance(scan, LogError):
                broken.append(str(scan))
                continue
            found.left_out.add(*broken)
            broken.clear()
            if found.takes(scan):
                measures.see(scan)
    except LogError as error:
        if isinstance(error, ClockError):
            raise
        trouble = str(error)
    if len(broken) == 1 and found.read:
        trouble = trouble or broken.pop()  # truncated within its last scan
    found.left_out.add(*broken)
    found.place_scanner()
    if not found.keyframes:
        raise LogError(found.left_out.first or trouble or "expected scans, found none")
    measures.check(said := [] if notes is None else notes)
    return replace(found.log(trouble), notes=tuple(said))


class _Gathered:
    """Processes scans one by one; only keyframes keep their ranges."""

    def __init__(self, config: KeyframesConfig) -> None:
        self.config = config
        self.keyframes: list[RawScan] = []
        self._poses: list[np.ndarray] = []
        self._times: list[float] = []
        self._of_scan: list[int] = []
        self._since: list[np.ndarray] = []
        self._ways: list[float] = []
        """Distance of the odometry up to each scan, in units of keyframes."""
        self._before: np.ndarray | None = None
        self._moved: np.ndarray | None = None
        """Odometry at the last scan that had moved far enough; `every` counts these."""
        self._until_next = 1
        self._head: list[RawScan] | None = []
        """The first scans, until the scanner's place on the robot is known."""
        self._on_robot = np.zeros(3)
        self._last_s = -np.inf
        self.left_out = LeftOut()

    @property
    def read(self) -> int:
        """Number of scans so far."""
        return len(self._times) + len(self._head or ())

    def takes(self, scan: RawScan) -> bool:
        """Process the next scan, or leave it out if it does not follow the one before; raises LogError when full."""
        last_s = self._last_s
        if not scan.time_s >= last_s:
            self.left_out.add(f"{scan.place}: expected time to go on from {last_s:.6f} s, found {scan.time_s:.6f} s")
            return False
        if scan.robot_odom is None:
            self.left_out.add(
                f"{scan.place}: expected odometry, found none: use a log with odometry, or --odometry scans"
            )
            return False
        self._last_s = scan.time_s
        self._add(scan)
        return True

    def _add(self, scan: RawScan) -> None:
        assert scan.robot_odom is not None
        if len(self.keyframes) * scan.ranges_m.nbytes > LIMIT_BYTES:
            raise LogError(f"{scan.place}: expected scans of {LIMIT_BYTES >> 20} MiB at most, found more")
        if self._head is None:
            self._take(scan)
            return
        self._head.append(scan)
        way = np.hypot(*(scan.robot_odom - _odom(self._head[0]))[:2])
        if way > FIRST_M or len(self._head) >= FIRST_SCANS:
            self.place_scanner()

    def place_scanner(self) -> None:
        """Estimate the scanner's place on the robot from the scans so far, and process these."""
        head, self._head = self._head, None
        if head:
            self._on_robot = scanner_on_robot(head)
            for scan in head:
                self._take(scan)

    def _take(self, scan: RawScan) -> None:
        pose = compose(_odom(scan), self._on_robot)
        if self._is_far(pose):
            self._moved = pose
            self._until_next -= 1
            if not self._until_next:
                self._until_next = self.config.every
                self.keyframes.append(scan)
                self._poses.append(pose)
        off = np.zeros(3) if self._before is None else compose(inverse(self._before), pose)
        self._before = pose
        worth = float(np.hypot(*off[:2])) / self.config.least_m + abs(float(off[2])) / self.config.least_rad
        self._ways.append(worth + (self._ways[-1] if self._ways else 0.0))
        self._times.append(scan.time_s)
        self._of_scan.append(len(self.keyframes) - 1)
        self._since.append(compose(inverse(self._poses[-1]), pose))

    def _is_far(self, pose: Float[np.ndarray, "3"]) -> bool:
        if self._moved is None:
            return True
        off = pose - self._moved
        return bool(np.hypot(*off[:2]) >= self.config.least_m or abs(wrap(off[2])) >= self.config.least_rad)

    def log(self, trouble: str) -> RecordedLog:
        """Return the log of the processed scans."""
        first, c = self.keyframes[0], self.config
        fans = np.array([fan_of(scan.bearings_rad) for scan in self.keyframes])
        widest = self.keyframes[int(np.argmax(fans[:, 0]))]
        motions = [compose(inverse(a), b) for a, b in pairwise(self._poses)]
        odometry = np.array([np.zeros(3), *motions])
        recording = Recording(
            np.array([scan.time_s for scan in self.keyframes]) - first.time_s,
            widest.bearings_rad,
            padded([scan.ranges_m for scan in self.keyframes]),
            np.full(len(widest.bearings_rad), c.sigma_m),
            first.range_max_m,
            odometry,
            wheels_cov(odometry, c),
            fans=differing(fans),
        )
        of = np.array(self._of_scan)
        return RecordedLog(
            recording, np.array(self._times), of, np.array(self._since), _shares(np.array(self._ways), of),
            self._on_robot, trouble, (), self.left_out,
        )  # fmt: skip


def _odom(scan: RawScan) -> Float[np.ndarray, "3"]:
    assert scan.robot_odom is not None
    return scan.robot_odom


def _shares(ways: Float[np.ndarray, " n"], of: Int[np.ndarray, " n"]) -> Float[np.ndarray, " n"]:
    """Return the position of each scan between two keyframes, 0 to 1; 0 after the last one."""
    at = np.append(ways[np.searchsorted(of, np.arange(of[-1] + 1))], np.inf)
    return np.asarray((ways - at[of]) / (at[of + 1] - at[of]))


def wheels_cov(odometry: Float[np.ndarray, "s 3"], config: KeyframesConfig) -> Float[np.ndarray, "s 3 3"]:
    """Return the covariance of the odometry; zero for the first motion, which does not exist."""
    sigma_m = config.wheels_m + config.wheels_share * np.hypot(*odometry[:, :2].T)
    sigma_rad = config.wheels_rad + config.turn_share * np.abs(odometry[:, 2])
    sigmas = np.stack([sigma_m, sigma_m, sigma_rad], axis=1)
    sigmas[0] = 0.0
    cov: np.ndarray = sigmas[:, :, None] ** 2 * np.eye(3)
    return cov
