"""Arrays from an untrusted .npz file: its headers are checked before any number is read."""

import math
import os
import stat
import tokenize
import zipfile
import zlib
from collections.abc import Mapping
from dataclasses import dataclass
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np

LIMIT_BYTES = 2**30
"""Larger archives are not read: 100,000 scans of 180 beams take a third of this."""
KINDS = {"float": "fiu", "int": "iu", "bool": "b", "text": "U"}
"""Accepted kinds of numpy types for each word of a layout."""
TYPES = {"float": np.float64, "int": np.int64, "bool": np.bool_}


BROKEN = (zipfile.BadZipFile, zlib.error, EOFError, RuntimeError, ValueError)
"""Errors of zipfile: other files, wrong checksums, broken or truncated data, encryption, unknown compressions, offsets
before the beginning of the file."""


class ArchiveError(ValueError):
    """A file with other arrays than it should have; the message says what was found."""


@dataclass(frozen=True)
class _Header:
    shape: tuple[int, ...]
    in_columns: bool
    dtype: np.dtype
    bytes: int


def regular(path: Path) -> Path:
    """Return the path to a regular file; raises OSError for devices, pipes, folders and missing files."""
    mode = os.stat(path).st_mode
    if stat.S_ISDIR(mode):
        raise IsADirectoryError(21, "a folder", str(path))
    if not stat.S_ISREG(mode):
        raise OSError(22, "not a regular file", str(path))
    return path


def read_archive(
    source: Path | bytes, needed: Mapping[str, str], welcome: Mapping[str, str] | None = None, others: str = ""
) -> dict[str, np.ndarray]:
    """Return the arrays of an .npz file that have the layouts wanted, never unpickling.

    A layout is a kind (`float`, `int`, `bool`, `text`) and the name or number of each dimension: with `"float s k"` and
    `"float s 3"` both arrays have the same number s of rows. Arrays in `welcome` may be missing; with `others`, a kind,
    all that are named nowhere are read, too, of whatever shape, and else they are left alone. Numbers come as float64
    and int64. Raises OSError for a file that cannot be read, and ArchiveError.
    """
    if isinstance(source, Path) and regular(source).stat().st_size > LIMIT_BYTES:
        raise ArchiveError(f"more than {LIMIT_BYTES >> 20} MiB")
    try:
        with zipfile.ZipFile(source if isinstance(source, Path) else BytesIO(source)) as archive:
            return _read(archive, needed, welcome or {}, others)
    except ArchiveError:
        raise
    except BROKEN as error:
        raise ArchiveError("an invalid or truncated archive of arrays") from error


def _read(
    archive: zipfile.ZipFile, needed: Mapping[str, str], welcome: Mapping[str, str], others: str
) -> dict[str, np.ndarray]:
    members = archive.infolist()
    names = [member.filename.removesuffix(".npy") for member in members]
    doubles = sorted({name for name in names if names.count(name) > 1}) if len(set(names)) < len(names) else []
    if doubles:
        raise ArchiveError(f"{doubles[0]} twice")
    missing = [name for name in needed if name not in names]
    if missing:
        raise ArchiveError(f"no {', '.join(missing)}")
    layouts = {**welcome, **needed}
    sizes: dict[str, int] = {}
    found: dict[str, np.ndarray] = {}
    total = 0
    for name, member in zip(names, members, strict=True):
        if name not in layouts and not others:
            continue
        with archive.open(member) as stream:
            header = _header(stream, name)
            if name in layouts:
                _agree(name, header, layouts[name], sizes)
            elif header.dtype.kind not in KINDS[others] + KINDS["bool"]:
                raise ArchiveError(f"{name} of type {header.dtype}")
            total += header.bytes
            if total > LIMIT_BYTES:
                raise ArchiveError(f"arrays of more than {LIMIT_BYTES >> 20} MiB")
            found[name] = _array(stream, name, header, layouts.get(name))
    return found


def _header(stream: Any, name: str) -> _Header:
    """Return the header of an array; raises ArchiveError, without reading the array, if it is invalid."""
    try:
        version = np.lib.format.read_magic(stream)
        read = np.lib.format.read_array_header_1_0 if version == (1, 0) else np.lib.format.read_array_header_2_0
        shape, in_columns, dtype = read(stream)
    except (ValueError, TypeError, SyntaxError, tokenize.TokenError, MemoryError, RecursionError) as error:
        raise ArchiveError(f"{name} without the header of an array") from error
    if any(size < 0 for size in shape):
        raise ArchiveError(f"{name} of shape {shape}")
    return _Header(shape, in_columns, dtype, math.prod(shape) * dtype.itemsize)


def _agree(name: str, header: _Header, layout: str, sizes: dict[str, int]) -> None:
    """Raise ArchiveError if an array has another layout; `sizes` collects the dimensions by name."""
    kind, *dims = layout.split()
    if header.dtype.kind not in KINDS[kind]:
        raise ArchiveError(f"{name} of type {header.dtype}, not {kind}")
    if len(header.shape) != len(dims):
        raise ArchiveError(f"{name} of shape {header.shape}, not ({', '.join(dims)})")
    for dim, size in zip(dims, header.shape, strict=True):
        expected = int(dim) if dim.isdecimal() else sizes.setdefault(dim, size)
        if size != expected:
            raise ArchiveError(f"{name} of shape {header.shape}, where {dim} is {expected}")


def _array(stream: Any, name: str, header: _Header, layout: str | None) -> np.ndarray:
    content = stream.read(header.bytes + 1)
    if len(content) != header.bytes:
        raise ArchiveError(f"{name} with other contents than its header says")
    array = np.frombuffer(content, header.dtype).reshape(header.shape, order="F" if header.in_columns else "C")
    kind = layout.split()[0] if layout else None
    if kind == "text":
        try:
            text = np.array(array.tolist())
            "".join(text.ravel().tolist()).encode()
        except (SystemError, UnicodeEncodeError) as error:
            raise ArchiveError(f"{name} of invalid characters") from error
        return text
    if kind == "int" and array.size and array.max() > np.iinfo(np.int64).max:
        raise ArchiveError(f"{name} with numbers beyond 64 bits")
    return np.array(array, dtype=TYPES[kind] if kind else array.dtype.newbyteorder("="), order="C")
