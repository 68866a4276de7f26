"""The settings of a trial as a JSON Schema: their ranges, units and docstrings."""

import inspect
from collections.abc import Iterator
from dataclasses import dataclass
from typing import Any

from docstring_parser import parse_from_object
from msgspec.json import schema

from chainslam.sim.logs.recorded_robot import FORMAT

from ..artifacts.saved import SavedConfig
from ..artifacts.schema import group_of, settings_in
from ..scenario import TrialConfig


@dataclass(frozen=True)
class Group:
    """A group of settings and its key."""

    key: str
    """Dotted, as `--set` takes it; empty for the settings of the trial itself."""
    kind: Any


def groups() -> Iterator[Group]:
    """Yield all groups of settings of a trial, each before its subgroups."""
    waiting = [Group("", TrialConfig)]
    while waiting:
        group = waiting.pop()
        yield group
        inner = [(name, group_of(kind)) for name, kind in settings_in(group.kind).items()]
        waiting += [Group(f"{group.key}.{name}".strip("."), kind) for name, kind in reversed(inner) if kind is not None]


def config_schema(some: bool = False) -> dict[str, Any]:
    """Return the JSON Schema of a run's `config.json`; with `some`, that of a file with some of its settings.

    It contains the constraints that msgspec checks, and the docstring of each setting.
    """
    whole: dict[str, Any] = schema(TrialConfig if some else SavedConfig)
    for group in groups():
        own = whole["$defs"][group.kind.__name__]
        known, told = settings_in(group.kind), words_of(group.kind)
        own["properties"] = {
            name: said | ({"description": told[name]} if name in told else {})
            for name, said in own["properties"].items()
            if name in known
        }
        own |= {"required": [] if some else list(known), "additionalProperties": False}
        own["description"] = inspect.cleandoc(group.kind.__doc__ or "")
    said = whole.pop("$defs")
    top = said.pop("TrialConfig" if some else "SavedConfig")
    if not some:
        top["properties"]["format"] = {"const": FORMAT}
        top["additionalProperties"] = False
    whole.pop("$ref")
    return {"$schema": "https://json-schema.org/draft/2020-12/schema", **top, "$defs": said}


def words_of(kind: Any) -> dict[str, str]:
    """Return the docstring of each field of a group of settings, including inherited ones."""
    found: dict[str, str] = {}
    for each in reversed(kind.__mro__[:-1]):
        found |= {told.arg_name: " ".join((told.description or "").split()) for told in parse_from_object(each).params}
    return found
