"""ROS 1 and ROS 2 bags: laser scans with the odometry in the bag, read by `rosbags` (an extra)."""

from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import replace
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from jaxtyping import Float

from chainslam.slam.geometry.poses import compose, inverse
from chainslam.slam.robot import Odometry, RobotError
from chainslam.slam.robot.deskew import de_skewed
from chainslam.slam.robot.ros.laser_scan import beam_s, is_covered, timed_scan
from chainslam.slam.robot.ros.odometry_buffer import OdometryBuffer
from chainslam.slam.robot.ros.transforms import Frames, planar, seconds

from .bag_topics import ODOMETRY, SCAN, BagTopics, TopicsWanted, topics_of
from .raw_scan import ClockError, LogError, RawScan
from .text_lines import first_bytes

MAGIC = b"#ROSBAG"
METADATA = "metadata.yaml"
SUFFIXES = (".bag", ".db3", ".mcap")
MOST_WAITING = 1000
"""Number of scans that may wait for odometry that comes later."""
GAP_S = 1.0
"""A scan this long after the last odometry has none."""
INSTALL = "install it: pip install 'chainslam[ros]'"


def is_bag(path: Path) -> bool:
    """Return whether a path is that of a ROS bag: a ROS 1 file, the folder of a ROS 2 bag, or a file in it."""
    if path.is_dir():
        return (path / METADATA).is_file()
    try:
        return path.suffix in SUFFIXES or first_bytes(path, len(MAGIC)) == MAGIC
    except OSError:
        return False


def read_bag(
    path: Path, wanted: TopicsWanted | None = None, notes: list[str] | None = None
) -> Iterator[RawScan | LogError]:
    """Yield the scans of a bag, and an error in place of each that cannot be read.

    Raises OSError, LogError where it holds none or breaks off, and ClockError.

    `notes` gets what was assumed, in words.
    """
    try:
        from rosbags.highlevel import AnyReader
        from rosbags.typesys import Stores, get_typestore
    except ImportError as error:
        raise LogError(f"expected the package rosbags to read a bag with, found none: {INSTALL}") from error
    if path.suffix in (".db3", ".mcap") and path.is_file():
        path = path.parent
    at = 0
    try:
        with (
            named_as_its_kind(path) as named,
            AnyReader([named], default_typestore=get_typestore(Stores.LATEST)) as reader,
        ):
            for scan in _scans(reader, wanted or TopicsWanted(), [] if notes is None else notes):
                yield scan
                at += isinstance(scan, RawScan)
    except (LogError, OSError):
        raise
    except RobotError as error:
        raise LogError(f"after scan {at}: {error}") from error
    except Exception as error:  # the reader may raise anything for a damaged bag
        words = " ".join(str(error).split())[:120] or type(error).__name__
        raise LogError(f"after scan {at}: expected more of the bag, found it damaged ({words})") from error


@contextmanager
def named_as_its_kind(path: Path) -> Iterator[Path]:
    """Yield a path to the same bag; rosbags treats everything named `*.bag` as a ROS 1 file, even a folder."""
    if not (path.is_dir() and path.suffix == ".bag"):
        yield path
        return
    with TemporaryDirectory() as folder:
        link = Path(folder) / "bag"
        link.symlink_to(path.resolve(), target_is_directory=True)
        yield link


def _scans(reader: Any, wanted: TopicsWanted, notes: list[str]) -> Iterator[RawScan | LogError]:
    topics = topics_of(reader, wanted, notes)
    frames, waiting, odometry = _frames(reader, topics, notes), deque[Any](), OdometryBuffer()
    covered: list[float] = []
    clocks = _Clocks()
    for connection, recorded_ns, raw in reader.messages(connections=topics.chosen):
        message = clocks.stamped(reader.deserialize(raw, connection.msgtype), recorded_ns)
        if connection.msgtype == SCAN:
            if is_covered(message):
                covered.append(seconds(message.header.stamp))
            else:
                waiting.append(message)
        elif connection.msgtype == ODOMETRY:
            time_s = clocks.told(seconds(message.header.stamp))
            odometry.add(time_s, planar(message.pose.pose.position, message.pose.pose))
        else:
            told = frames.take(message)
            for time_s, pose in () if topics.odometry else told:
                odometry.add(clocks.told(time_s), pose)
        while waiting and (_is_covered(waiting[0], odometry, topics) or len(waiting) > MOST_WAITING):
            clocks.scanned(seconds(waiting[0].header.stamp))
            yield _raw(waiting.popleft(), odometry, frames)
    for message in waiting:
        clocks.scanned(seconds(message.header.stamp))
        yield _raw(message, odometry, frames)
    if covered:
        notes.append(
            f"expected a scanner with free space around it, found it inside an object in {len(covered)} scans,"
            f" {covered[0]:.3f} s to {covered[-1]:.3f} s: returns nearer than its minimum range"
            " on opposite sides; these scans are left out"
        )
    clocks.tell(topics.tells_motion, notes)


class _Clocks:
    """The times of scans and odometry, which must be on one clock."""

    def __init__(self) -> None:
        self._scans: list[float] = []
        self._odometry = np.inf, -np.inf
        self._unstamped = 0

    def stamped(self, message: Any, recorded_ns: int) -> Any:
        """Return a message with a time stamp: that of the recording if its own is zero."""
        stamp = getattr(getattr(message, "header", None), "stamp", None)
        if stamp is None or seconds(stamp) != 0.0 or recorded_ns <= 0:
            return message
        self._unstamped += 1
        sec, nanosec = divmod(recorded_ns, 10**9)
        return replace(message, header=replace(message.header, stamp=replace(stamp, sec=sec, nanosec=nanosec)))

    def told(self, time_s: float) -> float:
        """Record the time of odometry, and return it."""
        self._odometry = min(self._odometry[0], time_s), max(self._odometry[1], time_s)
        return time_s

    def scanned(self, time_s: float) -> None:
        """Record the time of a scan."""
        self._scans.append(time_s)

    def tell(self, has_motion: bool, notes: list[str]) -> None:
        """Report assumptions; raises ClockError if no scan has a time with odometry."""
        first_s, last_s = self._odometry
        if self._unstamped:
            notes.append(
                f"expected messages with a time stamp, found {self._unstamped} that say 0: the time of"
                " recording is used"
            )
        late = sum(time_s > last_s + GAP_S for time_s in self._scans)
        early = sum(time_s < first_s - GAP_S for time_s in self._scans)
        if not has_motion or not late + early:
            return
        if late + early == len(self._scans):
            raise ClockError(
                f"expected scans and odometry on one clock, found scans from {min(self._scans):.3f} to"
                f" {max(self._scans):.3f} s and odometry from {first_s:.3f} to {last_s:.3f} s: record both with one"
                " clock (use_sim_time), or leave out the odometry"
            )
        for count, words in ((early, "before its beginning: its first pose is used"),
                             (late, "after its end: its last pose is used")):  # fmt: skip
            if count:
                notes.append(f"expected odometry for all scans, found {count} scans {words}")


def _is_covered(message: Any, odometry: OdometryBuffer, topics: BagTopics) -> bool:
    """Return whether the odometry during a scan is complete."""
    last_s = seconds(message.header.stamp) + max(beam_s(message) * len(message.ranges), 0.0)
    return odometry.newest_s >= last_s or not topics.tells_motion


def _frames(reader: Any, topics: BagTopics, notes: list[str]) -> Frames:
    """Return the frames, read until they contain the scanner's place, which may come late in a bag."""
    frames, scan = Frames(), topics.first(reader, SCAN)
    if topics.odometry and (first := topics.first(reader, ODOMETRY)) is not None:
        frames.body = first.child_frame_id
    frame = "" if scan is None else scan.header.frame_id
    for connection, _, raw in reader.messages(connections=topics.tf) if topics.tf else ():
        frames.take(reader.deserialize(raw, connection.msgtype))
        if frames.body and frames.tells(frame):
            return frames
    if topics.tells_motion and not frames.tells(frame):
        body = frames.body or "the body"
        notes.append(
            f"expected a transform from {body} to {frame or 'the scanner'}, found none: the scanner is assumed to"
            " be at the middle of the robot, facing ahead; record /tf_static with the bag"
        )
    return frames


def _raw(message: Any, odometry: OdometryBuffer, frames: Frames) -> RawScan | LogError:
    where = f"scan at {seconds(message.header.stamp):.6f} s"
    place, is_turned = frames.on_body(message.header.frame_id)
    try:
        taken = timed_scan(message, is_turned)
        if not len(odometry):
            return _told(de_skewed(replace(taken, start_s=taken.end_s), _rests), None, None, where)
        scan = de_skewed(taken, lambda from_s, to_s: _at_scanner(odometry.motion(from_s, to_s), place))
    except RobotError as error:
        return LogError(f"{where}: {error}")
    robot = odometry.pose(scan.time_s)
    return _told(scan, robot, compose(robot, place), where)


def _told(scan: Any, robot: Any, scanner: Any, where: str) -> RawScan:
    return RawScan(scan.time_s, scan.bearings_rad, scan.ranges_m, scan.range_max_m, robot, scanner, where)


def _rests(_: float, __: float) -> Odometry:
    return Odometry(np.zeros(3), np.zeros((3, 3)))


def _at_scanner(motion: Float[np.ndarray, "3"], place: Float[np.ndarray, "3"]) -> Odometry:
    """Return the motion of a scanner, given its place on the robot and the motion of the robot."""
    return Odometry(compose(compose(inverse(place), motion), place), np.zeros((3, 3)))
