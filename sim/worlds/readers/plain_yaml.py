"""A strict reader of small YAML files: one mapping of plain values and lists of them.

YAML's aliases, merges and tags can turn a kilobyte into gigabytes, and text into objects. The description of a map
needs none of them.
"""

import re
from collections.abc import Iterator
from typing import Any

import yaml

from ..drawing import WorldError, shorten

FILE_MAX = 64 * 2**10
DEEPEST = 4
NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?")
WORDS: dict[str, bool | None] = {"true": True, "false": False, "null": None, "~": None, "": None}

Value = Any
"""Text, a number, a truth or nothing; a list of values; a mapping of text to values."""


def plain_mapping(
    data: bytes, what: str = "a ROS map YAML", holding: str = " with image: and resolution:"
) -> dict[str, Value]:
    """Return the mapping in a YAML file's bytes, every number as a float; raise WorldError for anything else.

    `what` it should be, and `holding` which keys, are words for the message.
    """
    if len(data) > FILE_MAX:
        raise WorldError(f"expected a YAML file of at most {FILE_MAX} bytes, found {len(data)}: shorten it")
    try:
        # What reads these files in a robot (yaml-cpp) takes a tab between a key and its value, PyYAML does not.
        events = yaml.parse(data.replace(b"\t", b" "), Loader=yaml.SafeLoader)
        documents = [_value(events, next(events), 0) for event in events if isinstance(event, yaml.DocumentStartEvent)]
    except WorldError:
        raise
    except (yaml.YAMLError, ValueError, OverflowError) as error:
        raise WorldError(f"expected {what}, found {shorten(str(error))}: correct the file") from None
    if len(documents) != 1 or not isinstance(documents[0], dict):
        found = shorten(documents[0]) if len(documents) == 1 else f"{len(documents)} documents"
        raise WorldError(f"expected {what}{holding}, found {found}: correct it")
    return documents[0]


def as_number(value: Value) -> Value:
    """Return a number that stands in quotes, as yaml-cpp, a robot's reader, takes it; other values as they are."""
    return float(value) if isinstance(value, str) and NUMBER.fullmatch(value.strip()) else value


def _value(events: Iterator[yaml.Event], event: yaml.Event, depth: int) -> Value:
    """Return the value that begins with an event, taking the rest of it from `events`."""
    if isinstance(event, yaml.AliasEvent):
        raise WorldError(f"expected values in the YAML file, found the alias *{shorten(event.anchor)}: write them out")
    if (tag := getattr(event, "tag", None)) is not None:
        raise WorldError(f"expected plain values in the YAML file, found the tag {shorten(tag)}: leave it out")
    if isinstance(event, yaml.ScalarEvent):
        return event.value if event.style else _scalar(event.value)
    if depth == DEEPEST:
        raise WorldError(f"expected values at most {DEEPEST} deep in the YAML file, found deeper ones: flatten it")
    if isinstance(event, yaml.SequenceStartEvent):
        return [_value(events, item, depth + 1) for item in _until(events, yaml.SequenceEndEvent)]
    mapping: dict[str, Value] = {}
    for key in _until(events, yaml.MappingEndEvent):
        name = str(_value(events, key, depth + 1))
        if name in mapping:
            raise WorldError(f"expected each key once in the YAML file, found {shorten(name)} twice: take one away")
        mapping[name] = _value(events, next(events), depth + 1)
    return mapping


def _until(events: Iterator[yaml.Event], end: type[yaml.Event]) -> Iterator[yaml.Event]:
    """Yield events up to one of a kind; whoever takes them may take more in between."""
    for event in events:
        if isinstance(event, end):
            return
        yield event


def _scalar(text: str) -> str | float | bool | None:
    """Return what a value without quotes means."""
    if NUMBER.fullmatch(text):
        return float(text)
    return WORDS.get(text.lower(), text)
