"""ROS 1 and ROS 2 bags: laser scans with the odometry that a bag holds beside them, read by `rosbags` (an extra)."""

import math
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Any

import numpy as np
from jaxtyping import Float

from slam.geometry.poses import compose, inverse, wrap

from .raw_scan import LogError, RawScan
from .text_lines import first_bytes

MAGIC = b"#ROSBAG"
METADATA = "metadata.yaml"
SUFFIXES = (".bag", ".db3", ".mcap")
SCAN, ODOMETRY, TF = "sensor_msgs/msg/LaserScan", "nav_msgs/msg/Odometry", "tf2_msgs/msg/TFMessage"
TF_OLD = "tf/msg/tfMessage"
MOST_WAITING = 1000
"""Scans that wait for odometry that comes after them."""
INSTALL = "install it: pip install 'chainslam[ros]'"


def is_bag(path: Path) -> bool:
    """Return whether a path is that of a ROS bag: a ROS 1 file, or the folder of a ROS 2 bag or a file in it."""
    if path.is_dir():
        return (path / METADATA).is_file()
    try:
        return path.suffix in SUFFIXES or first_bytes(path, len(MAGIC)) == MAGIC
    except OSError:
        return False


def read_bag(path: Path) -> Iterator[RawScan]:
    """Yield the scans of a bag; raises OSError, and LogError where it holds none or where it breaks off."""
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
            _by_another_name(path) as named,
            AnyReader([named], default_typestore=get_typestore(Stores.LATEST)) as reader,
        ):
            for scan in _scans(reader):
                yield scan
                at += 1
    except (LogError, OSError):
        raise
    except Exception as error:  # a damaged bag makes the reader fail in any way
        words = " ".join(str(error).split())[:120] or type(error).__name__
        raise LogError(f"after scan {at}: expected more of the bag, found it damaged ({words})") from error


@contextmanager
def _by_another_name(path: Path) -> Iterator[Path]:
    """Yield a path to the same bag; rosbags takes all that is named `*.bag` for a file of ROS 1, a folder too."""
    if not (path.is_dir() and path.suffix == ".bag"):
        yield path
        return
    with TemporaryDirectory() as folder:
        link = Path(folder) / "bag"
        link.symlink_to(path.resolve(), target_is_directory=True)
        yield link


def _scans(reader: Any) -> Iterator[RawScan]:
    topics = _Topics(reader.connections)
    frames, waiting = _Frames(), deque[Any]()
    odometry: deque[tuple[float, np.ndarray]] = deque(maxlen=2)
    for connection, _, raw in reader.messages(connections=topics.chosen):
        message = reader.deserialize(raw, connection.msgtype)
        if connection.msgtype == SCAN:
            waiting.append(message)
        elif connection.msgtype == ODOMETRY:
            odometry.append((_seconds(message.header.stamp), _planar(message.pose.pose.position, message.pose.pose)))
            frames.body = message.child_frame_id
        else:
            frames.take(message, None if topics.has_odometry else odometry)
        while (
            waiting
            and odometry
            and (_seconds(waiting[0].header.stamp) <= odometry[-1][0] or len(waiting) > MOST_WAITING)
        ):
            yield _raw(waiting.popleft(), odometry, frames)
    if not odometry:
        raise LogError(f"expected odometry, or a tf from an odom frame, found none beside the scans: {topics.told}")
    for message in waiting:
        yield _raw(message, odometry, frames)


class _Topics:
    """Which topics of a bag are read: the first of scans, and the first of odometry or all of tf."""

    def __init__(self, connections: list[Any]) -> None:
        self.told = "the bag has " + (
            ", ".join(sorted({f"{c.topic} ({c.msgtype})" for c in connections})) or "no topic"
        )
        scans, odometry = (sorted({c.topic for c in connections if c.msgtype == kind}) for kind in (SCAN, ODOMETRY))
        has_tf = any(c.msgtype in (TF, TF_OLD) for c in connections)
        if not scans or not (odometry or has_tf):
            raise LogError(f"expected a topic of LaserScan and one of Odometry or tf, found others: {self.told}")
        self.has_odometry = bool(odometry)
        names = (*scans[:1], *odometry[:1])
        self.chosen = [c for c in connections if c.topic in names or c.msgtype in (TF, TF_OLD)]


class _Frames:
    """Where frames sit on each other, as far as it does not change, and the odometry that tf tells."""

    def __init__(self) -> None:
        self.body = ""
        self._on: dict[str, tuple[str, np.ndarray, bool]] = {}
        """For each frame its parent, its pose there, and whether it lies upside down."""

    def take(self, message: Any, odometry: deque[tuple[float, np.ndarray]] | None) -> None:
        """Take in transforms; those from an odom frame go to `odometry` where no topic tells it."""
        for transform in message.transforms:
            parent, child = transform.header.frame_id.strip("/"), transform.child_frame_id.strip("/")
            pose = _planar(transform.transform.translation, transform.transform)
            if "odom" in parent:
                if odometry is not None:
                    odometry.append((_seconds(transform.header.stamp), pose))
                    self.body = child
            elif "map" not in parent:
                self._on[child] = (parent, pose, _upward(_rotation_of(transform.transform)) < 0.0)

    def on_body(self, frame: str) -> tuple[Float[np.ndarray, "3"], bool]:
        """Return a frame's pose on the robot's body, and whether it lies upside down; zero where nothing tells it."""
        pose, is_turned = np.zeros(3), False
        frame, body = frame.strip("/"), self.body.strip("/")
        for _ in range(len(self._on) + 1):
            if frame == body or frame not in self._on:
                break
            frame, on_parent, over = self._on[frame]
            if over:
                pose = pose * np.array([1.0, -1.0, -1.0])
            pose, is_turned = compose(on_parent, pose), is_turned != over
        return pose, is_turned


def _raw(message: Any, odometry: deque[tuple[float, np.ndarray]], frames: _Frames) -> RawScan:
    time_s = _seconds(message.header.stamp)
    robot = _between(time_s, odometry)
    place, is_turned = frames.on_body(message.header.frame_id)
    step = float(message.angle_increment)
    ranges = np.asarray(message.ranges, dtype=np.float64)
    where = f"scan at {time_s:.6f} s"
    if len(ranges) < 2 or not step or not math.isfinite(step) or not math.isfinite(message.angle_min):
        raise LogError(f"{where}: expected beams, found {len(ranges)} of them {step:g} rad apart")
    # The last beams of a turn that is told twice are the first ones again.
    ranges = ranges[: max(math.ceil(2.0 * np.pi / abs(step) - 0.5), 2)]
    bearings = message.angle_min + step * np.arange(len(ranges))
    if is_turned:
        bearings = -bearings
    if bearings[1] < bearings[0]:
        bearings, ranges = bearings[::-1].copy(), ranges[::-1]
    most = float(message.range_max)
    if not 0.0 < most < math.inf:
        raise LogError(f"{where}: expected the scanner's maximum range, found {most:g} m")
    near = ~(ranges >= max(float(message.range_min), 1e-3))
    told = np.where(ranges >= most, np.inf, np.where(near, np.nan, ranges))
    return RawScan(time_s, bearings, told, most, robot, compose(robot, place), where)


def _between(time_s: float, odometry: deque[tuple[float, np.ndarray]]) -> Float[np.ndarray, "3"]:
    """Return the pose at a time between the last two, or the nearer of them where it lies outside."""
    (before, first), (after, last) = odometry[0], odometry[-1]
    share = min(max((time_s - before) / (after - before), 0.0), 1.0) if after > before else 1.0
    motion = compose(inverse(first), last)
    return compose(first, np.append(share * motion[:2], share * wrap(motion[2])))


def _seconds(stamp: Any) -> float:
    return float(stamp.sec) + 1e-9 * float(stamp.nanosec)


def _rotation_of(pose: Any) -> Any:
    return pose.orientation if hasattr(pose, "orientation") else pose.rotation


def _upward(q: Any) -> float:
    """Return how much of a frame's up points up in the frame that it sits on."""
    return 1.0 - 2.0 * float(q.x * q.x + q.y * q.y)


def _planar(place: Any, pose: Any) -> Float[np.ndarray, "3"]:
    """Return place and heading in the plane: where a frame's ahead points, seen from above."""
    q = _rotation_of(pose)
    heading = math.atan2(2.0 * (q.w * q.z + q.x * q.y), 1.0 - 2.0 * (q.y * q.y + q.z * q.z))
    found = np.array([place.x, place.y, heading], dtype=np.float64)
    if not np.all(np.isfinite(found)):
        raise LogError("expected a finite pose in the bag, found NaN or infinity")
    return found
