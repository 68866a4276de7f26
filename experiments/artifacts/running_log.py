"""The log of a run under way: one record per step, appended to one file.

However the run ends, its steps are kept: `--resume` compares the new drive with them. An incomplete last record is
ignored. The file is removed once all results are written, since `log.npz` contains everything in it.

A record consists of its length, a checksum, and the data: first the format and the config as JSON, then for each step
the time, the odometry with its covariance, and the ranges, as 64-bit numbers.
"""

import json
import os
import struct
from collections.abc import Iterator, Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any
from zlib import crc32

import numpy as np
from jaxtyping import Float

from chainslam.explore.step import Step
from chainslam.sim.logs.recorded_robot import FORMAT

from ..usage import UsageError
from .files import json_bytes, write
from .results import RUNNING
from .run_folder import FolderGoneError, unwritable

_NUMBER = "<f8"
_BEFORE = 1 + 3 + 9
"""Numbers per step before its ranges."""
_HEAD = struct.Struct("<II")


@dataclass(frozen=True)
class Kept:
    """The content of a running log; s steps, k beams."""

    config: bytes
    """The record for `config.json`."""
    records: bytes
    """The complete records of steps, as bytes."""
    time_s: Float[np.ndarray, " s"]
    ranges_m: Float[np.ndarray, "s k"]
    odometry: Float[np.ndarray, "s 3"]


class RunningLog:
    """Appends each step to a file in a folder; a full disk ends the file, not the run."""

    def __init__(self, folder: Path, config: Mapping[str, Any], kept: Kept | None = None) -> None:
        """Start the file, or continue after the steps that were kept of it; raises UsageError."""
        self._folder, self._path = folder, folder / RUNNING
        self._steps = 0 if kept is None else len(kept.time_s)
        begin = json.dumps({"format": FORMAT, "config": json_bytes(config).decode()})
        try:
            write(self._path, _record(begin.encode()) + (b"" if kept is None else kept.records))
            self._file: int | None = os.open(self._path, os.O_WRONLY | os.O_APPEND)
        except OSError as error:
            raise unwritable(folder, error) from error

    def add(self, step: Step) -> None:
        """Append a step unless it is there already; raises FolderGoneError if the file was removed."""
        if self._file is None:
            return
        self.check()
        if step.index < self._steps:
            return
        wheels = step.odometry.reported
        numbers = np.concatenate([[step.time_s], wheels.motion, wheels.cov.ravel(), step.scan.ranges_m])
        message = _record(numbers.astype(_NUMBER).tobytes())
        before = os.fstat(self._file).st_size
        try:
            whole = os.write(self._file, message) == len(message)
        except OSError:
            whole = False
        if not whole:
            with suppress(OSError):
                os.truncate(self._path, before)
            self.close()
        self._steps += 1

    def check(self) -> None:
        """Raise FolderGoneError if the file is no longer in the folder."""
        if self._file is None:
            return
        try:
            there = os.path.samestat(os.fstat(self._file), os.stat(self._path))
        except OSError:
            there = False
        if not there:
            raise FolderGoneError(self._folder)

    def close(self) -> None:
        """Stop appending."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def remove(self) -> None:
        """Remove the file, once its content is kept elsewhere."""
        self.close()
        with suppress(OSError):
            self._path.unlink()


def _record(held: bytes) -> bytes:
    return _HEAD.pack(len(held), crc32(held)) + held


def _records(content: bytes) -> Iterator[tuple[int, bytes]]:
    """Yield the end and the content of each complete record; an incomplete one and what follows it are ignored."""
    at = 0
    while at + _HEAD.size <= len(content):
        length, checksum = _HEAD.unpack_from(content, at)
        at += _HEAD.size + length
        held = content[at - length : at]
        if len(held) < length or crc32(held) != checksum:
            return
        yield at, held


def read_running(folder: Path) -> Kept | None:
    """Return the content of the file in a folder, None without a file; raises UsageError for an invalid one."""
    path = folder / RUNNING
    try:
        content = path.read_bytes()
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _none(path, error.strerror or "unreadable") from error
    records = _records(content)
    began, begin = next(records, (0, b""))
    try:
        said = json.loads(begin)
        config = said["config"].encode()
    except (ValueError, KeyError, TypeError, AttributeError) as error:
        raise _none(path, "not written by chainslam") from error
    if said.get("format") != FORMAT:
        raise _none(path, f"format {said.get('format')}")
    end, steps = began, list[np.ndarray]()
    for after, held in records:
        if len(held) < 8 * _BEFORE or len(held) % 8 or (steps and len(held) != 8 * len(steps[0])):
            break
        steps.append(np.frombuffer(held, _NUMBER))
        end = after
    numbers = np.array(steps) if steps else np.empty((0, _BEFORE))
    return Kept(config, content[began:end], numbers[:, 0], numbers[:, _BEFORE:], numbers[:, 1:4])


def _none(path: Path, found: str) -> UsageError:
    return UsageError(
        f"expected the log of a run under way, found {path} ({found}): delete it, or start again with --force"
    )
