"""Recorded logs of real robots, in any format, recognised by their content."""

import gzip
import zipfile
import zlib
from collections.abc import Callable, Iterator
from pathlib import Path

from .archive import BROKEN
from .bag_topics import TopicsWanted
from .breezyslam import is_breezyslam, read_breezyslam
from .carmen import read_carmen
from .keyframes import KeyframesConfig, RecordedLog, gather
from .raw_scan import LogError, RawScan
from .recorded_robot import RecordingError
from .rosbag import is_bag, read_bag
from .text_lines import GZIP, first_bytes

PDF, PICTURE = "a PDF document", "a picture"
PACKED = {
    b"PK": "a zip file",
    b"BZh": "a file packed by bzip2",
    b"\xfd7zXZ": "a file packed by xz",
    b"(\xb5/\xfd": "a file packed by zstd",
    b'\x04"M\x18': "a file packed by lz4",
    b"7z\xbc\xaf": "a 7z archive",
    b"Rar!": "a RAR archive",
    b"%PDF": PDF,
    b"\x89PNG": PICTURE,
}
"""Formats that are not logs, or are packed, by their first bytes."""
UNPACK = "unpack it, and name a log in it"
TAR_AT, TAR = 257, b"ustar"
LONGEST_HEAD = TAR_AT + len(TAR)


def is_own_log(path: Path) -> bool:
    """Return whether a file is a run's own `log.npz`, by its name or because it is an archive of arrays."""
    try:
        if path.suffix == ".npz":
            return True
        if first_bytes(path, 2) != b"PK":
            return False
        with zipfile.ZipFile(path) as archive:
            return any(name.endswith(".npy") for name in archive.namelist())
    except (OSError, *BROKEN):
        return False


def _refuse_packed(path: Path) -> None:
    """Raise LogError, with the name of the format, for archives and other files that are not logs."""
    if path.is_dir():
        return
    head = first_bytes(path, LONGEST_HEAD)
    for begin, words in PACKED.items():
        if head.startswith(begin):
            raise LogError(f"{words}: {UNPACK if words not in (PDF, PICTURE) else 'name a log'}")
    if head.startswith(GZIP):
        try:
            with gzip.open(path) as file:
                head = file.read(LONGEST_HEAD)
        except (EOFError, zlib.error, gzip.BadGzipFile):
            return  # its reader reports the position
    if head[TAR_AT:] == TAR:
        raise LogError(f"a tar archive: {UNPACK}")


KEYFRAMES = KeyframesConfig()
ANY_TOPICS = TopicsWanted()


def read_recorded_log(
    path: Path,
    config: KeyframesConfig = KEYFRAMES,
    wanted: TopicsWanted = ANY_TOPICS,
    motion_of: Callable[[Iterator[RawScan | LogError]], Iterator[RawScan | LogError]] = iter,
) -> RecordedLog:
    """Return a CARMEN or BreezySLAM log or a ROS bag; raises RecordingError if no scan can be used.

    `wanted` names the topics of a bag, and `motion_of` computes the odometry of scans without any.
    """
    notes: list[str] = []
    try:
        if wanted != ANY_TOPICS and not is_bag(path):
            raise LogError(
                "expected a ROS bag to name topics of, found another log: leave out --scan-topic and --odom-topic"
            )
        return gather(motion_of(_scans(path, wanted, notes)), config, notes)
    except LogError as error:
        raise RecordingError(f"expected a recorded log, found {path.resolve().name}: {error}") from error
    except OSError as error:
        reason = error.strerror or type(error).__name__
        raise RecordingError(
            f"expected a recorded log, found {path.resolve().name} ({reason}): name a log that exists"
        ) from error


def _scans(path: Path, wanted: TopicsWanted, notes: list[str]) -> Iterator[RawScan | LogError]:
    if is_bag(path):
        return read_bag(path, wanted, notes)
    _refuse_packed(path)
    return read_breezyslam(path, notes) if is_breezyslam(path) else read_carmen(path, notes)
