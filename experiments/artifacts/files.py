"""Atomic file writes: complete or not at all, the same bytes for the same content, with a format number."""

import csv
import errno
import json
import math
import os
import re
import tempfile
from collections.abc import Iterable, Mapping, Sequence
from io import BytesIO, StringIO
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.sim.logs.recorded_robot import FORMAT

CONFIG = "config.json"
"""The file of settings in the folder of a run, a campaign or merged campaigns."""
PART = re.compile(r"\..+\.\d+\.part")
"""Names of files that are being written; a killed process leaves them behind."""


def write(path: Path, content: bytes) -> None:
    """Write a file atomically: under a temporary name first, then renamed; raises OSError with the file's name."""
    temporary = path.with_name(f".{path.name}.{os.getpid()}.part")
    try:
        with temporary.open("wb") as file:
            file.write(content)
            file.flush()
            # Without this, a power failure may leave the new name with an empty file.
            os.fsync(file.fileno())
        temporary.replace(path)
    except OSError as error:
        # The error of a full disk has no file name, and users should not see the temporary one.
        error.filename, error.filename2 = str(path), None
        raise
    finally:
        temporary.unlink(missing_ok=True)


def stamp() -> dict[str, int]:
    """Return the header of a file that is read back; its keys and order only change with the number."""
    return {"format": FORMAT}


def format_fault(said: Any) -> str:
    """Return what is wrong with the format number of a file, in words; empty if it can be read."""
    if type(said) is int and said == FORMAT:
        return ""
    shown = said if isinstance(said, int | float) else type(said).__name__
    return f"format {str(shown)[:20]} of another version, where this one reads {FORMAT}"


def replacing(path: Path) -> str:
    """Return a note that an earlier file is about to be replaced; empty if there is none."""
    return ", in place of an earlier one" if path.exists() else ""


def probe(path: Path) -> None:
    """Raise OSError, leaving nothing behind, if `write_anywhere` could not write."""
    if path.is_dir():
        raise IsADirectoryError(errno.EISDIR, os.strerror(errno.EISDIR), str(path))
    if not path.exists() or path.is_file():
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=path.parent):
            return


def write_anywhere(path: Path, content: bytes) -> None:
    """Write to a path given by the user: create its folder, and keep what is not a regular file (a device or a pipe).

    Raises OSError, with nothing left behind.
    """
    if path.exists() and not path.is_file():
        with path.open("wb") as stream:
            stream.write(content)
        return
    path.parent.mkdir(parents=True, exist_ok=True)
    write(path, content)


def json_bytes(value: Any) -> bytes:
    """Return a value as indented JSON; arrays become lists, and NaN or infinity null."""
    text = json.dumps(_plain(value), indent=1, ensure_ascii=False, allow_nan=False) + "\n"
    # A path may hold bytes that are no UTF-8, to Python halves of surrogate pairs: as \\udc80 they come back.
    return text.encode(errors="backslashreplace")


def npz_bytes(arrays: Mapping[str, Any]) -> bytes:
    """Return arrays as an .npz archive without pickles or time stamps."""
    buffer = BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, **{name: np.asarray(array) for name, array in arrays.items()})
    return buffer.getvalue()


def csv_bytes(header: Sequence[str], rows: Iterable[Sequence[Any]]) -> bytes:
    """Return a table as CSV; floats with all their digits, NaN and None as empty cells."""
    text = StringIO()
    writer = csv.writer(text, lineterminator="\n")
    writer.writerow(header)
    writer.writerows([["" if _is_missing(cell) else _plain(cell) for cell in row] for row in rows])
    return text.getvalue().encode()


def _is_missing(cell: Any) -> bool:
    return cell is None or (isinstance(cell, float | np.floating) and not math.isfinite(cell))


def _plain(value: Any) -> Any:
    """Convert a value to JSON's own types."""
    if isinstance(value, Mapping):
        return {str(key): _plain(item) for key, item in value.items()}
    if isinstance(value, list | tuple):
        return [_plain(item) for item in value]
    if isinstance(value, np.ndarray):
        return _plain(value.tolist())
    if isinstance(value, np.generic):
        return _plain(value.item())
    if isinstance(value, float) and not math.isfinite(value):
        return None
    if isinstance(value, Path):
        return str(value)
    return value
