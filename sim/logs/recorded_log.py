"""Recorded logs of real robots, whatever their format: told by their contents."""

from pathlib import Path

from .carmen import read_carmen
from .keyframes import KeyframesConfig, RecordedLog, gather
from .raw_scan import LogError
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


def read_recorded_log(path: Path, config: KeyframesConfig = KEYFRAMES) -> RecordedLog:
    """Return a CARMEN log or a ROS bag; raises RecordingError, in one line, where not one scan can be used."""
    try:
        return gather(read_bag(path) if is_bag(path) else read_carmen(path), config)
    except LogError as error:
        raise RecordingError(f"expected a recorded log, found {path.name}: {error}") from error
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise RecordingError(
            f"expected a recorded log, found {path.name} ({reason}): name a log that exists"
        ) from error
