"""A strict reader of small YAML files: one mapping of plain values and lists of them.

YAML's aliases, merges and tags can turn a kilobyte into gigabytes, and text into objects. The description of a map
needs none of them.
"""

import re
from typing import Any, cast

import yaml

from ..drawing import WorldError, shorten

FILE_MAX = 64 * 2**10
DEEPEST = 4
NUMBER = re.compile(r"[-+]?([0-9]+(\.[0-9]*)?|\.[0-9]+)([eE][-+]?[0-9]+)?\Z")

Value = Any
"""Text, a number, a truth or nothing; a list of values; a mapping of text to values."""


class _Plain(yaml.SafeLoader):
    """PyYAML's safe loader without aliases, tags, keys that stand there twice, and YAML's many words for a value."""

    yaml_implicit_resolvers: dict[str, Any] = {}  # noqa: RUF012  (PyYAML says that it is an instance's)
    _depth = 0

    def compose_node(self, parent: yaml.Node | None, index: Any) -> yaml.Node | None:
        event = cast(Any, self).peek_event()
        if isinstance(event, yaml.AliasEvent):
            raise WorldError(
                f"expected values in the YAML file, found the alias *{shorten(event.anchor)}: write them out"
            )
        if event.tag is not None:
            raise WorldError(
                f"expected plain values in the YAML file, found the tag {shorten(event.tag)}: leave it out"
            )
        if isinstance(event, yaml.CollectionStartEvent) and self._depth == DEEPEST:
            raise WorldError(f"expected values at most {DEEPEST} deep in the YAML file, found deeper ones: flatten it")
        self._depth += 1
        node = super().compose_node(parent, index)
        self._depth -= 1
        return node

    def construct_mapping(self, node: yaml.MappingNode, deep: bool = False) -> dict[Any, Value]:
        mapping: dict[Any, Value] = {}
        for key, value in node.value:
            name = str(self.construct_object(key, deep=True))
            if name in mapping:
                raise WorldError(f"expected each key once in the YAML file, found {shorten(name)} twice: take one away")
            mapping[name] = self.construct_object(value, deep=True)
        return mapping


for _kind, _pattern, _first in (
    ("float", NUMBER, [*"+-.0123456789"]),
    ("bool", re.compile(r"(true|false)\Z", re.IGNORECASE), [*"tTfF"]),
    ("null", re.compile(r"(null|~)?\Z", re.IGNORECASE), ["n", "N", "~", ""]),
):
    _Plain.add_implicit_resolver(f"tag:yaml.org,2002:{_kind}", _pattern, _first)


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
        documents = list(yaml.load_all(data.replace(b"\t", b" "), _Plain))
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
