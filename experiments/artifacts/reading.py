"""Reading of result files: regular files of bounded size, of this format, and of the expected kind.

Anything else raises a UsageError with one line.
"""

import json
import math
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.sim.logs.archive import ArchiveError, read_archive, regular
from chainslam.sim.worlds import WorldError
from chainslam.slam.robot import RobotError

from ..usage import UsageError
from .files import format_fault
from .schema import UnfitError, fit

LIMIT_BYTES = 2**26
"""Larger JSON files are not read."""
DEPTH = 32
"""Deeper nested values were not written by this program."""


@contextmanager
def told(path: Path, todo: str) -> Iterator[None]:
    """Convert an error of reading a file into a UsageError: what was expected, what was found, what to do."""
    expected = f"expected {path.name} as this version writes it in {path.parent}"
    try:
        yield
    except FileNotFoundError as error:
        raise UsageError(f"{expected}, found none: {todo}") from error
    except OSError as error:
        raise UsageError(f"{expected}, found {error.strerror or type(error).__name__}: {todo}") from error
    except (UnfitError, ArchiveError) as error:
        raise UsageError(f"{expected}, found {error}: {todo}") from error
    except (RobotError, WorldError) as error:
        raise UsageError(f"{error} (in {path})") from error


def read_json(path: Path, kind: Any, todo: str) -> dict[str, Any]:
    """Return the object in a file of this format with at least the keys of a kind; raises UsageError."""
    with told(path, todo):
        return _formed(read_plain(path), kind)


def parse_json(content: bytes, kind: Any) -> dict[str, Any]:
    """Return the object in JSON of this format with at least the keys of a kind; raises UnfitError."""
    return _formed(plain_json(content), kind)


def read_plain(path: Path) -> dict[str, Any]:
    """Return the object in a file of JSON, whatever its keys; raises UnfitError, OSError."""
    if regular(path).stat().st_size > LIMIT_BYTES:
        raise UnfitError(f"more than {LIMIT_BYTES >> 20} MiB")
    return fit(dict, plain_json(path.read_bytes()))


def plain_json(content: bytes) -> Any:
    """Return what some JSON holds, of bounded depth, without a number that is none or a key twice; raises UnfitError.

    msgspec's own decoder keeps the last of a key's values without a word.
    """
    try:
        said = json.loads(content.decode(), object_pairs_hook=_once)
    except UnfitError:
        raise
    except (ValueError, RecursionError) as error:
        raise UnfitError("invalid or truncated JSON") from error
    check_plain(said)
    return said


def check_plain(said: Any) -> None:
    """Raise UnfitError for values nested deeper than `DEPTH`, numbers that are not finite, and control characters."""
    level, depth = [said], 0
    while level:
        depth += 1
        if depth > DEPTH:
            raise UnfitError(f"values nested more than {DEPTH} deep")
        below: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                below += [*value.keys(), *value.values()]
            elif isinstance(value, list):
                below += value
            elif isinstance(value, float) and not math.isfinite(value):
                raise UnfitError(f"the number {json.dumps(value)}")
            elif isinstance(value, str) and not _is_text(value):
                raise UnfitError(f"text with invalid characters ({ascii(value)[:30]})")
        level = below


def check_format(said: Mapping[str, Any]) -> None:
    """Raise UnfitError if the format number is missing or unknown."""
    if "format" not in said:
        raise UnfitError("no format number")
    if wrong := format_fault(said["format"]):
        raise UnfitError(wrong)


def read_arrays(path: Path, needed: Mapping[str, str], todo: str) -> dict[str, np.ndarray]:
    """Return the arrays of an .npz file of this format, by their layouts (`sim.logs.archive`); raises UsageError."""
    with told(path, todo):
        said = read_archive(path, {"format": "int"})["format"]
        if wrong := format_fault(int(said)):
            raise ArchiveError(wrong)
        return read_archive(path, needed)


def _formed(said: Any, kind: Any) -> dict[str, Any]:
    whole = fit(dict, said)
    check_format(whole)
    fit(kind, whole)
    return whole


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object; raises UnfitError if a key occurs twice."""
    said = dict(pairs)
    if len(said) < len(pairs):
        raise UnfitError("a duplicate key")
    return said


def _is_text(value: str) -> bool:
    return value.isprintable() or not any(
        0xD800 <= ord(letter) < 0xE000 or (ord(letter) < 0xA0 and not letter.isprintable() and letter not in "\n\t\r")
        for letter in value
    )
