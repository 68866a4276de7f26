"""Validation of values by msgspec: settings (dataclasses) and the content of results (structs).

Settings are read strictly, since a setting that is not understood would mean another run: no key may be missing or
unknown. In results, unknown keys are ignored, since a later version may write more.
"""

import json
import re
from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from functools import cache
from types import GenericAlias
from typing import Any, get_args, get_type_hints

from msgspec import ValidationError, convert
from msgspec.json import schema

from chainslam.slam.geometry.quantities import allowed
from chainslam.slam.robot import STATED

STEP = re.compile(r"\.(\w+)|\[(\d+|\.\.\.)\]")
"""Part of the location in msgspec's messages: the key of an object, the index of a list, or any key."""


def many(kind: Any) -> Any:
    """Return the kind of a list of one kind."""
    return GenericAlias(list, (kind,))


class UnfitError(ValueError):
    """A value of another kind than expected: which one, and its content."""


class UnknownKeyError(UnfitError):
    """A key that does not exist."""

    def __init__(self, key: str, near: str = "") -> None:
        super().__init__(f"the unknown key {key[:80]!r}{near}")
        self.key = key


def fit(kind: Any, value: Any, name: str = "") -> Any:
    """Convert plain values to a kind; raises UnfitError, or what the kind itself raises, for anything else."""
    check_keys(kind, value, name)
    try:
        return convert(value, kind)
    except ValidationError as error:
        if isinstance(error.__cause__, ValueError):
            raise error.__cause__ from None
        raise UnfitError(_words(str(error), kind, value, name)) from error


@cache
def settings_in(group: Any) -> dict[str, Any]:
    """Return the types of the settings of a group by their names, without what is stated elsewhere."""
    hints = get_type_hints(group, include_extras=True)
    return {each.name: hints[each.name] for each in fields(group) if not each.metadata.get(STATED)}


def group_of(kind: Any) -> Any:
    """Return the dataclass in a type or in its optional form; None if it is neither."""
    options = [kind, *get_args(kind)]
    return next((option for option in options if isinstance(option, type) and is_dataclass(option)), None)


def check_keys(kind: Any, value: Any, name: str = "", some: bool = False) -> None:
    """Raise UnfitError for keys of settings that there are not, and for those that are missing.

    Where `some` settings will do, none is missing, and each is held against what it may be by itself; else values are
    left to whoever fits the whole.
    """
    group = group_of(kind)
    if group is None or not isinstance(value, Mapping):
        if some:
            fit(kind, value, name)
        return
    known = settings_in(group)
    for key, inner in value.items():
        if key not in known:
            raise UnknownKeyError(_under(name, key))
        check_keys(known[key], inner, _under(name, key), some)
    for key in known.keys() - value.keys() if not some else ():
        raise UnfitError(f"no {_under(name, key)}")
    if some and name and not value:
        raise UnfitError(f"nothing in {name}, which holds several settings")


def shown(value: Any) -> str:
    """Return a value in few letters."""
    if isinstance(value, dict | list | tuple):
        return "an object" if isinstance(value, dict) else f"a list of {len(value)}"
    text = repr(value) if isinstance(value, str) else json.dumps(value, default=repr)
    return text if len(text) <= 40 else f"{text[:37]}..."


def part_of(whole: Mapping[str, Any], said: Mapping[str, Any], step: str) -> Mapping[str, Any]:
    """Return the part of a JSON Schema for a key or an entry; empty if it has none."""
    for each in said.get("anyOf", [said]):
        each = resolved(whole, each)
        inner = each.get("properties", {}).get(step)
        if inner is None and step.isdecimal() and each.get("type") == "array":
            first = each.get("prefixItems", [])[int(step) : int(step) + 1]
            inner = first[0] if first else each.get("items") or None
        if inner is not None:
            return resolved(whole, inner)
    return {}


def resolved(whole: Mapping[str, Any], said: Mapping[str, Any]) -> Mapping[str, Any]:
    """Return a part of a JSON Schema, or the one that it refers to."""
    return whole["$defs"][said["$ref"].rpartition("/")[2]] if "$ref" in said else said


def _words(told: str, kind: Any, value: Any, name: str) -> str:
    """Return a readable form of msgspec's message about a value: what was found where, and what is allowed."""
    words, _, place = told.partition(" - at `$")
    whole = schema(kind)
    said = resolved(whole, whole)
    for key, number in STEP.findall(place):
        step = key or number
        name = _under(name, step)
        if step == "...":
            return f"{words[:1].lower()}{words[1:]} in {name}"
        value = value[int(number)] if number else value[key]
        said = part_of(whole, said, step)
    if words.startswith("Object missing required field"):
        return f"no {_under(name, words.split('`')[1])}"
    return f"{shown(value)} where {name or 'the file'} should be {allowed(said)}"


def _under(name: str, key: str) -> str:
    return f"{name}.{key}" if name else key
