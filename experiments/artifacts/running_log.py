"""A run's log while the run goes on: one batch a step at the end of one Arrow stream.

Whatever ends the run, the steps up to then are there: `--resume` holds the new drive against them. A batch that was
cut short is left out. Once all results are written the stream is removed: `log.npz` holds all of it.
"""

import os
from collections.abc import Mapping
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pyarrow as pa
from jaxtyping import Float

from chainslam.explore.step import Step
from chainslam.sim.logs.recorded_robot import FORMAT

from ..usage import UsageError
from .files import json_bytes, write
from .results import RUNNING
from .run_folder import FolderGoneError, unwritable

_COLUMNS = ("time_s", "ranges_m", "odometry", "odometry_cov")
_FIELDS = [(name, pa.list_(pa.float64())) for name in _COLUMNS]


@dataclass(frozen=True)
class Kept:
    """What the stream of a run holds; s steps, k beams."""

    config: bytes
    """What `config.json` is to hold."""
    batches: bytes
    """The whole batches as they stand in the file."""
    time_s: Float[np.ndarray, " s"]
    ranges_m: Float[np.ndarray, "s k"]
    odometry: Float[np.ndarray, "s 3"]


class RunningLog:
    """Appends each step to the stream in a folder; a disk that is full ends the stream and not the run."""

    def __init__(self, folder: Path, config: Mapping[str, Any], kept: Kept | None = None) -> None:
        """Begin the stream, or go on behind the steps that were kept of it; raises UsageError."""
        self._folder, self._path = folder, folder / RUNNING
        self._steps = 0 if kept is None else len(kept.time_s)
        metadata = {"format": str(FORMAT), "config": json_bytes(config).decode()}
        self._schema = pa.schema(_FIELDS, metadata=metadata)
        batches = b"" if kept is None else kept.batches
        try:
            write(self._path, self._schema.serialize().to_pybytes() + batches)
            self._file: int | None = os.open(self._path, os.O_WRONLY | os.O_APPEND)
        except OSError as error:
            raise unwritable(folder, error) from error

    def add(self, step: Step) -> None:
        """Append a step unless it is there already; raises FolderGoneError where the stream was taken away."""
        if self._file is None:
            return
        self.check()
        if step.index < self._steps:
            return
        wheels = step.odometry.reported
        rows = ([step.time_s], step.scan.ranges_m, wheels.motion, wheels.cov)
        message = _batch(self._schema, rows)
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
        """Raise FolderGoneError where the stream is no longer the one in the folder."""
        if self._file is None:
            return
        try:
            there = os.path.samestat(os.fstat(self._file), os.stat(self._path))
        except OSError:
            there = False
        if not there:
            raise FolderGoneError(self._folder)

    def close(self) -> None:
        """Append no more."""
        if self._file is not None:
            os.close(self._file)
            self._file = None

    def remove(self) -> None:
        """Remove the stream: what it holds is kept elsewhere, or was kept before."""
        self.close()
        with suppress(OSError):
            self._path.unlink()


def _batch(schema: pa.Schema, rows: tuple[Any, ...]) -> bytes:
    """Return one step as the bytes of a batch."""
    arrays = []
    for row in rows:
        values = np.ascontiguousarray(row, dtype=np.float64).ravel()
        # From buffers: any other way from numpy to Arrow imports pandas first, which takes 0.3 s.
        inner = pa.Array.from_buffers(pa.float64(), len(values), [None, pa.py_buffer(values)])
        offsets = pa.py_buffer(np.array([0, len(values)], dtype=np.int32))
        arrays.append(pa.Array.from_buffers(pa.list_(pa.float64()), 1, [None, offsets], children=[inner]))
    return pa.RecordBatch.from_arrays(arrays, schema=schema).serialize().to_pybytes()


def read_running(folder: Path) -> Kept | None:
    """Return what the stream in a folder holds, None where there is none; raises UsageError for a file that is none."""
    path = folder / RUNNING
    try:
        source = pa.BufferReader(path.read_bytes())
    except FileNotFoundError:
        return None
    except OSError as error:
        raise _none(path, error.strerror or "unreadable") from error
    try:
        reader = pa.ipc.open_stream(source)
        said = {key.decode(): value.decode() for key, value in (reader.schema.metadata or {}).items()}
        config = said["config"].encode()
    except (pa.ArrowException, OSError, ValueError, KeyError) as error:
        raise _none(path, "none of ours") from error
    if said.get("format") != str(FORMAT) or not reader.schema.equals(pa.schema(_FIELDS)):
        raise _none(path, f"format {said.get('format')}")
    began = end = source.tell()
    steps: list[list[Any]] = []
    while (step := _next(reader)) is not None and _fits(step, steps):
        steps.append(step)
        end = source.tell()
    source.seek(began)
    columns = [np.array([step[k] for step in steps]) for k in range(len(_COLUMNS))]
    if not steps:
        columns = [np.empty((0, 1)), np.empty((0, 0)), np.empty((0, 3))]
    return Kept(config, source.read(end - began), columns[0][:, 0], columns[1], columns[2])


def _next(reader: Any) -> list[Any] | None:
    """Return the next step of a stream, None at its end and where it was cut short."""
    try:
        batch = reader.read_next_batch()
        batch.validate(full=True)
    except (StopIteration, pa.ArrowException, OSError):
        return None
    if batch.num_rows != 1 or any(column.null_count for column in batch.columns):
        return None
    # Through values without a copy; they have no nulls of their own, or they are none of ours.
    inner = [column.flatten() for column in batch.columns]
    return None if any(values.null_count for values in inner) else [values.to_numpy() for values in inner]


def _fits(step: list[Any], steps: list[list[Any]]) -> bool:
    """Return whether a step has the sizes of a step, and those of the first one."""
    sizes = [len(values) for values in step]
    return sizes == ([1, sizes[1], 3, 9] if not steps else [len(values) for values in steps[0]])


def _none(path: Path, found: str) -> UsageError:
    return UsageError(
        f"expected the log of a run under way, found {path} ({found}): delete it, or explore anew with --force"
    )
