"""Recorded logs of real robots, whatever their format: told by their contents."""

from collections.abc import Callable, Iterator
from dataclasses import replace
from pathlib import Path

from .bag_topics import TopicsWanted
from .carmen import read_carmen
from .keyframes import KeyframesConfig, RecordedLog, gather
from .raw_scan import LogError, RawScan
from .recorded_robot import RecordingError
from .rosbag import is_bag, read_bag
from .text_lines import first_bytes

ARCHIVE = b"PK"
"""A run's own log begins so."""


def is_own_log(path: Path) -> bool:
    """Return whether a file is a run's own `log.npz`, or is at least named so."""
    try:
        return path.suffix == ".npz" or first_bytes(path, 2) == ARCHIVE
    except OSError:
        return False


KEYFRAMES = KeyframesConfig()
ANY_TOPICS = TopicsWanted()


def read_recorded_log(
    path: Path,
    config: KeyframesConfig = KEYFRAMES,
    wanted: TopicsWanted = ANY_TOPICS,
    motion_of: Callable[[Iterator[RawScan]], Iterator[RawScan]] = iter,
) -> RecordedLog:
    """Return a CARMEN log or a ROS bag; raises RecordingError, in one line, where not one scan can be used.

    `wanted` names the topics of a bag, and `motion_of` tells the odometry of scans that have none.
    """
    notes: list[str] = []
    try:
        if wanted != ANY_TOPICS and not is_bag(path):
            raise LogError(
                "expected a ROS bag to name topics of, found another log: leave out --scan-topic and --odom-topic"
            )
        scans = read_bag(path, wanted, notes) if is_bag(path) else read_carmen(path)
        return replace(gather(motion_of(scans), config), notes=tuple(notes))
    except LogError as error:
        raise RecordingError(f"expected a recorded log, found {path.name}: {error}") from error
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise RecordingError(
            f"expected a recorded log, found {path.name} ({reason}): name a log that exists"
        ) from error
