"""Files of results read again: plain, of bounded size, of this format, with the keys and types that they must have.

Whatever else a file holds is told in one line by a UsageError. What a shape does not name is left alone, since a later
version may keep more; a dataclass is read strictly, since a setting that is not understood would be another run.
"""

import json
import math
import types
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from dataclasses import dataclass, fields, is_dataclass
from pathlib import Path
from typing import Any, Literal, Union, get_args, get_origin, get_type_hints

import numpy as np

from sim.logs.archive import ArchiveError, read_archive, regular
from slam.robot import STATED

from ..usage import UsageError
from .formats import fault

LIMIT_BYTES = 2**26
"""A JSON file of more than this is not read."""
DIGITS, DEPTH = 20, 32
"""A number of more digits, or values nested deeper, are nothing that this program wrote."""

Shape = Any
"""A type; a dataclass; a dict of the shapes under each key, with `?` at its end one that may be missing, with `!` one
that must be; `[shape]` for a list; or one of the classes below."""


@dataclass(frozen=True)
class Each:
    """The shape of an object with keys of any name."""

    shape: Shape


@dataclass(frozen=True)
class Maybe:
    """A shape or null."""

    shape: Shape


class Word:
    """One of some values."""

    def __init__(self, *values: Any) -> None:
        self.values = values


class All:
    """Of every one of some shapes."""

    def __init__(self, *shapes: Shape) -> None:
        self.shapes = shapes


class OneOf:
    """Of one of some shapes; the last one says what does not fit."""

    def __init__(self, *shapes: Shape) -> None:
        self.shapes = shapes


class UnfitError(ValueError):
    """A value of another shape than expected: which one, and what it is."""


@contextmanager
def told(path: Path, todo: str) -> Iterator[None]:
    """Turn what goes wrong in reading a file into a UsageError: what was expected, what was found, what to do."""
    expected = f"expected {path.name} as this version writes it in {path.parent}"
    try:
        yield
    except FileNotFoundError as error:
        raise UsageError(f"{expected}, found none: {todo}") from error
    except OSError as error:
        raise UsageError(f"{expected}, found {error.strerror or type(error).__name__}: {todo}") from error
    except (UnfitError, ArchiveError) as error:
        raise UsageError(f"{expected}, found {error}: {todo}") from error


def read_json(path: Path, shape: Mapping[str, Shape], todo: str) -> dict[str, Any]:
    """Return the object in a file named in `FORMATS`, of a shape; raises UsageError, with what to do about it."""
    with told(path, todo):
        return _formed(read_plain(path), path.name, shape)


def parse_json(content: bytes, name: str, shape: Mapping[str, Shape]) -> dict[str, Any]:
    """Return the object in the JSON of a file with a name of `FORMATS`, of a shape; raises UnfitError."""
    return _formed(plain_json(content), name, shape)


def read_plain(path: Path) -> dict[str, Any]:
    """Return the object in a file of JSON, whatever its keys; raises UnfitError, OSError."""
    if regular(path).stat().st_size > LIMIT_BYTES:
        raise UnfitError(f"more than {LIMIT_BYTES >> 20} MiB")
    said = plain_json(path.read_bytes())
    if not isinstance(said, dict):
        raise UnfitError(f"{_shown(said)} where the file should be an object")
    return said


def plain_json(content: bytes) -> Any:
    """Return what some JSON holds, of bounded depth and length, without a number that is none; raises UnfitError."""
    try:
        said = json.loads(
            content.decode(),
            parse_int=_whole,
            parse_float=_real,
            parse_constant=_real,
            object_pairs_hook=_once,
        )
    except UnfitError:
        raise
    except (ValueError, RecursionError) as error:
        raise UnfitError("no JSON, or some that was cut short") from error
    _plain(said)
    return said


def _once(pairs: list[tuple[str, Any]]) -> dict[str, Any]:
    """Return an object of which every key stands there once."""
    said = dict(pairs)
    if len(said) < len(pairs):
        raise UnfitError("a key that stands there twice")
    return said


def _formed(said: Any, name: str, shape: Mapping[str, Shape]) -> dict[str, Any]:
    check_format(said, name)
    fit(shape, said)
    return dict(said)


def check_format(said: Any, name: str, older: bool = True) -> None:
    """Raise UnfitError where what a file says has no format that is read."""
    if not isinstance(said, dict) or "format" not in said:
        raise UnfitError("no format number")
    if wrong := fault(said["format"], name, older):
        raise UnfitError(wrong)


def read_arrays(path: Path, needed: Mapping[str, str], todo: str) -> dict[str, np.ndarray]:
    """Return the arrays of an .npz file of this format, by their layouts (`sim.logs.archive`); raises UsageError."""
    with told(path, todo):
        said = read_archive(path, {"format": "int"})["format"]
        if wrong := fault(int(said), path.name):
            raise ArchiveError(wrong)
        return read_archive(path, needed)


def fit(shape: Shape, value: Any, name: str = "") -> Any:
    """Return a value of JSON, with dataclasses in place of their records; raises UnfitError for another shape."""
    if isinstance(shape, Maybe):
        return None if value is None else fit(shape.shape, value, name)
    if isinstance(shape, All):
        return [fit(each, value, name) for each in shape.shapes][-1]
    if isinstance(shape, OneOf):
        return _one_of(shape.shapes, value, name)
    if isinstance(shape, Word):
        _expect(any(type(v) is type(value) and v == value for v in shape.values), "another word", value, name)
        return value
    if isinstance(shape, dict):
        _expect(isinstance(value, dict), "an object", value, name)
        for key, inner in shape.items():
            bare = key.rstrip("?!")
            if bare in value:
                _expect(not key.endswith("!"), "missing", value[bare], _under(name, bare))
                fit(inner, value[bare], _under(name, bare))
            elif bare == key:
                raise UnfitError(f"no {_under(name, key)}")
        return value
    if isinstance(shape, Each):
        _expect(isinstance(value, dict), "an object", value, name)
        return {key: fit(shape.shape, inner, _under(name, key)) for key, inner in value.items()}
    if isinstance(shape, list):
        _expect(isinstance(value, list), "a list", value, name)
        return [fit(shape[0], inner, _under(name, str(k))) for k, inner in enumerate(value)]
    if is_dataclass(shape):
        return _record(shape, value, name)
    return _of_type(shape, value, name)


def _one_of(shapes: tuple[Shape, ...], value: Any, name: str) -> Any:
    for shape in shapes[:-1]:
        try:
            return fit(shape, value, name)
        except UnfitError:
            continue
    return fit(shapes[-1], value, name)


def _record(kind: Any, value: Any, name: str) -> Any:
    _expect(isinstance(value, dict), "an object", value, name)
    hints, known = (
        get_type_hints(kind),
        [field.name for field in fields(kind) if field.init and not field.metadata.get(STATED)],
    )
    for key in known:
        if key not in value:
            raise UnfitError(f"no {_under(name, key)}")
    for key in value:
        if key not in known:
            raise UnfitError(f"an unknown {_shown(_under(name, key))}")
    return kind(**{key: fit(hints[key], value[key], _under(name, key)) for key in known})


def _of_type(kind: Any, value: Any, name: str) -> Any:
    origin, inner = get_origin(kind), get_args(kind)
    if kind is Any:
        return value
    if origin in (Union, types.UnionType):
        options = [option for option in inner if option is not type(None)]
        if value is None:
            _expect(len(options) < len(inner), "a value", value, name)
            return None
        fitting = [option for option in options if _is_of(option, value)] or options
        return fit(fitting[0], value, name)
    if kind in (list, dict):
        _expect(isinstance(value, kind), "a list" if kind is list else "an object", value, name)
        return value
    if origin is Literal:
        _expect(value in inner, f"one of {', '.join(map(str, inner))}", value, name)
        return value
    if origin is tuple:
        _expect(isinstance(value, list), "a list", value, name)
        kinds = [inner[0]] * len(value) if inner[-1] is ... else list(inner)
        _expect(len(kinds) == len(value), f"{len(kinds)} values", value, name)
        return tuple(fit(*pair, _under(name, str(k))) for k, pair in enumerate(zip(kinds, value, strict=True)))
    words = {float: "a number", int: "a whole number", str: "text", bool: "true or false"}
    _expect(_is_of(kind, value), words[kind], value, name)
    return float(value) if kind is float else value


def _is_of(kind: Any, value: Any) -> bool:
    return type(value) in ((int, float) if kind is float else (kind,))


def _expect(holds: bool, words: str, value: Any, name: str) -> None:
    if not holds:
        raise UnfitError(f"{_shown(value)} where {name or 'the file'} should be {words}")


def _under(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key


def _shown(value: Any) -> str:
    """Return a value in few letters."""
    if isinstance(value, dict | list):
        return "an object" if isinstance(value, dict) else f"a list of {len(value)}"
    text = repr(value) if isinstance(value, str) else json.dumps(value)
    return text if len(text) <= 40 else f"{text[:37]}..."


def _whole(text: str) -> int:
    if len(text) > DIGITS:
        raise UnfitError(f"a number of {len(text)} digits")
    return int(text)


def _real(text: str) -> float:
    value = float(text) if len(text) < 400 else math.nan
    if not math.isfinite(value):
        raise UnfitError(f"the number {text if len(text) <= 20 else f'{text[:17]}...'}")
    return value


def _plain(said: Any) -> None:
    """Raise UnfitError for values nested deeper than `DEPTH`, and for text that cannot be written or moves a cursor."""
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
            elif isinstance(value, str) and not _is_text(value):
                raise UnfitError(f"text that nobody can read ({ascii(value)[:30]})")
        level = below


def _is_text(value: str) -> bool:
    return value.isprintable() or not any(
        0xD800 <= ord(letter) < 0xE000 or (ord(letter) < 0xA0 and not letter.isprintable() and letter not in "\n\t\r")
        for letter in value
    )
