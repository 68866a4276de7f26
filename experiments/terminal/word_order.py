"""Forgiving word order: a file after an option with many values, and a run's folder in place of its file."""

import os
from collections.abc import Iterator, Sequence
from dataclasses import fields, is_dataclass, replace
from pathlib import Path
from typing import Any, get_args, get_origin, get_type_hints

import tyro

MANY = 10**6
FILES = {"log": "log.npz", "config": "config.json"}
"""The file of a run that is used if its folder is given."""


def in_order(words: Sequence[str], command: type) -> list[str]:
    """Return the words of a command with its file first, if an option with many values would take it.

    In `replay --backend full-ekf graph run.log` the last word is the log: it exists, and no other word names one.
    """
    name, taken = _positional(command), list(_taken(words, command))
    if not name or any(not option for option, _ in taken):
        return list(words)
    for option, places in taken:
        if len(places) > 1 and _is_many(command, option) and os.path.lexists(words[places[-1]]):
            at = places[-1]
            return [words[0], words[at], *words[1:at], *words[at + 1 :]]
    return list(words)


def swallowed(words: Sequence[str], command: type) -> str:
    """Return a note on the option that took the last word, if the command's file is missing; else an empty one."""
    for option, places in _taken(words, command):
        if places and _is_many(command, option):
            return f" ({option} takes {words[places[-1]]!r} as well)"
    return ""


def with_files(command: Any) -> Any:
    """Return a command with a run's file where its folder was given."""
    found = {}
    for name, file in FILES.items():
        path = getattr(command, name, None)
        if isinstance(path, Path):
            found[name] = file_in(path, file)
    return replace(command, **found) if found else command


def file_in(path: Path, name: str) -> Path:
    """Return a run's file if the path is its folder, otherwise the path."""
    return path / name if path.is_dir() and (path / name).is_file() else path


def _taken(words: Sequence[str], command: type) -> Iterator[tuple[str, list[int]]]:
    """Yield each option with the positions of its values; "" for words outside of options."""
    kinds = _values(command)
    at = 1
    while at < len(words):
        option, equals, _ = words[at].partition("=")
        if not option.startswith("--"):
            yield "", [at]
            at += 1
            continue
        most = 0 if equals else kinds.get(option, 0)
        end = at + 1
        while end < len(words) and end - at <= most and not words[end].startswith("--"):
            end += 1
        yield option, list(range(at + 1, end))
        at = end


def _values(command: type) -> dict[str, int]:
    """Return the largest number of values of each option."""
    hints, most = get_type_hints(command, include_extras=True), dict[str, int]()
    for each in fields(command):
        inner = _plain(hints[each.name])
        if isinstance(inner, type) and is_dataclass(inner):
            most |= _values(inner)
            continue
        parts = (inner, *getattr(hints[each.name], "__metadata__", ()))
        option = f"--{each.name.replace('_', '-')}"
        if isinstance(each.default, bool) or tyro.conf.Suppress in parts or tyro.conf.Positional in parts:
            continue
        several = next((kind for kind in (parts[0], *get_args(parts[0])) if get_origin(kind) is tuple), None)
        if several is None or "UseAppendAction" in str(hints[each.name]):
            most[option] = 1
        else:
            most[option] = MANY if Ellipsis in get_args(several) else len(get_args(several))
    return most


def _is_many(command: type, option: str) -> bool:
    return _values(command).get(option, 0) == MANY


def _plain(hint: Any) -> Any:
    return get_args(hint)[0] if hasattr(hint, "__metadata__") else hint


def _positional(command: type) -> str:
    """Return the field of a command's file or world; empty for a command with none or many."""
    hints = get_type_hints(command, include_extras=True)
    marks = {each.name: getattr(hints[each.name], "__metadata__", ()) for each in fields(command)}
    named = [name for name, mark in marks.items() if tyro.conf.Positional in mark]
    single = [name for name in named if get_origin(_plain(hints[name])) is not tuple]
    return single[0] if single else ""
