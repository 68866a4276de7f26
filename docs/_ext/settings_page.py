"""The page docs/reference/settings.md, from the dataclasses that hold the settings: `make settings`."""

import json
import math
from collections.abc import Iterator, Mapping
from typing import Any, get_args

from msgspec.json import schema

from chainslam.experiments.artifacts.schema import group_of, settings_in
from chainslam.experiments.artifacts.settings import defaults
from chainslam.experiments.views.settings_schema import Group, groups, words_of

INTRODUCTION = """# Settings

<!-- made by `make settings` -->

Every setting of a run. Its full key is the heading of its table, a dot and the key in the first column; the settings of
the first table have no prefix:

    .venv/bin/chainslam explore hall --set mission.mapper.matching.gate=0.95 --set seed=2

A value is written as in JSON, and text may stand without quotes. `--config FILE` reads several settings from a JSON
file, such as the `config.json` of a run; `chainslam schema` prints its JSON Schema. An option of the command has
priority over `--set`, `--set` over `--config`, and that over the robot's file (`--robot`). A key that does not exist
and a value outside its range end the command with one line and exit status 2. Values within the range are not checked
for being sensible.

In the tables a *segment* is what one scan shows of a wall, a *wall* is a landmark of the map, and a *face* is one side
of a true wall. A wall is *tentative* until it is confirmed. An *open end* is an end of a wall at which the chain of
walls does not continue yet.
"""
COLUMNS = "| key | default | unit | range | meaning |\n|---|---|---|---|---|"
SYMBOLS = {math.pi: "π", -math.pi: "-π", 2 * math.pi: "2π", -2 * math.pi: "-2π", 2**31: "2^31"}


def page() -> str:
    """Return the page in Markdown."""
    return "\n".join([INTRODUCTION, *(line for group in groups() for line in section(group))])


def section(group: Group) -> Iterator[str]:
    """Yield the lines of a group's table; none where it only holds other groups."""
    own = {name: kind for name, kind in settings_in(group.kind).items() if group_of(kind) is None}
    words, values, (use, is_optional) = words_of(group.kind), at(group.key), use_of(group.key)
    if not own and not use:
        return
    yield f"## `{group.key}`\n" if group.key else "## The run\n"
    off = f"\n\n`--set {group.key}=null` switches this off." if is_optional else ""
    yield f"{first_paragraph(group.kind.__doc__)}{off} {use}".strip() + "\n"
    if own:
        yield COLUMNS
        yield from (row(name, values[name], schema(kind), words[name]) for name, kind in own.items())
        yield ""


def first_paragraph(text: str) -> str:
    """Return the first paragraph of a docstring in one line."""
    return " ".join(text.partition("\n\n")[0].split())


def row(name: str, value: Any, said: Mapping[str, Any], words: str) -> str:
    """Return the row of one setting, by its name, its default and its JSON Schema."""
    unit = unit_of(said)
    cells = [f"`{name}`", default_of(value, unit), unit, range_of(said), words]
    return f"| {' | '.join(cells)} |"


def at(key: str) -> dict[str, Any]:
    """Return the defaults of the group with this dotted key."""
    found: Any = defaults()
    for step in filter(None, key.split(".")):
        found = found[step]
    return dict(found)


def use_of(key: str) -> tuple[str, bool]:
    """Return what the group above says of this one, and whether it may be null."""
    above, _, name = key.rpartition(".")
    parent = next(each.kind for each in groups() if each.key == above)
    known = settings_in(parent)
    return words_of(parent).get(name, ""), type(None) in get_args(known.get(name))


def default_of(value: Any, unit: str) -> str:
    """Return a default as it may be typed, with four digits; of an angle in degrees, too."""
    if isinstance(value, float):
        degrees = f" ({math.degrees(value):.4g}°)" if unit == "rad" and value else ""
        return f"`{number(value, digits=4)}`{degrees}"
    return f"`{value}`" if isinstance(value, str) and value else f"`{json.dumps(value)}`"


def unit_of(said: Mapping[str, Any]) -> str:
    """Return the unit that a JSON Schema tells of its numbers, if any."""
    inner = *filter(None, [said.get("items")]), *said.get("anyOf", ()), *said.get("prefixItems", ())
    return said.get("unit", "") or next(filter(None, map(unit_of, inner)), "")


def range_of(said: Mapping[str, Any]) -> str:
    """Return in a few words what a JSON Schema allows, without the unit."""
    match said:
        case {"anyOf": options}:
            return " or ".join(map(range_of, options))
        case {"enum": options}:
            return ", ".join(map(str, options))
        case {"exclusiveMinimum": low, "exclusiveMaximum": high}:
            return f"between {number(low)} and {number(high)}"
        case {"minimum": low, "maximum": high}:
            return f"{number(low)} to {number(high)}"
        case {"minimum": low}:
            return f"from {number(low)}"
        case {"type": "array", "prefixItems": pair}:
            return f"[{', '.join(map(range_of, pair))}]"
        case {"type": "array", "items": inner}:
            least, most = said.get("minItems", 0), said.get("maxItems")
            count = f" of {least} to {most}" if most else f" of {least} or more" if least else ""
            return f"list{count}: {range_of(inner)}"
        case {"type": "boolean"}:
            return "true, false"
        case {"type": kind}:
            return {"string": "text"}.get(kind, kind)
    raise ValueError(f"expected what a setting may be, found {said}")


def number(value: float, digits: int = 3) -> str:
    """Return a number in few letters."""
    symbol = next((name for known, name in SYMBOLS.items() if math.isclose(known, value, rel_tol=1e-7)), "")
    return symbol if symbol and digits < 4 else f"{value:.{digits}g}".replace("e+0", "e").replace("e-0", "e-")


if __name__ == "__main__":
    print(page(), end="")
