"""What the number in a setting may be: types with a range and a unit, declared beside each field.

`msgspec` holds values against them where they come in, and makes the JSON Schema of them. Every type has both ends, so
that neither infinity nor NaN is one of its values. The smallest sizes are far below what makes sense, and large enough
that nothing divides by zero or runs for hours.
"""

from collections.abc import Mapping
from dataclasses import fields, is_dataclass
from math import pi
from typing import Annotated, Any, TypeAlias, get_type_hints

import numpy as np
from msgspec import Meta, ValidationError, convert, to_builtins
from msgspec.json import schema

_M, _RAD, _S, _M_S = ({"unit": unit} for unit in ("m", "rad", "s", "m/s"))

Share: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0)]
"""Of a whole."""
Part: TypeAlias = Annotated[float, Meta(ge=1e-6, le=1.0)]
"""A share that is not nothing."""
Probability: TypeAlias = Annotated[float, Meta(gt=0.0, lt=1.0)]
"""Neither impossible nor certain: its logarithm and that of the rest are finite."""
Factor: TypeAlias = Annotated[float, Meta(ge=1e-9, le=1e9)]
"""How many times."""
Weight: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e9)]
"""A cost, a gain, or a factor that may be nothing."""
Times: TypeAlias = Annotated[float, Meta(ge=0.0, le=100.0)]
"""As much as stated; it may be nothing."""
Sigmas: TypeAlias = Annotated[float, Meta(ge=1e-3, le=1e6)]
"""So many standard deviations."""

Size: TypeAlias = Annotated[float, Meta(ge=1e-3, le=1e6, extra_json_schema=_M)]
"""Of a cell, a step, a body, a range: something that others are divided by or made of."""
Body: TypeAlias = Annotated[float, Meta(ge=1e-3, le=10.0, extra_json_schema=_M)]
"""Of a robot, a person, or one step of theirs."""
Sight: TypeAlias = Annotated[float, Meta(ge=1e-3, le=200.0, extra_json_schema=_M)]
"""How far a scanner sees."""
Pitch: TypeAlias = Annotated[float, Meta(ge=1e-4, le=1e6, extra_json_schema=_M)]
"""Between places that are tried one after the other."""
Distance: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e6, extra_json_schema=_M)]
"""That may be nothing: a margin, a tolerance, a way."""
Deviation: TypeAlias = Annotated[float, Meta(ge=1e-6, le=1e6, extra_json_schema=_M)]
"""A standard deviation that weights are made of."""
Place: TypeAlias = Annotated[float, Meta(ge=-1e7, le=1e7, extra_json_schema=_M)]
"""A coordinate."""

Offset: TypeAlias = Annotated[float, Meta(ge=-10.0, le=10.0, extra_json_schema=_M)]
"""Of a device on its robot."""
Slip: TypeAlias = Annotated[float, Meta(ge=0.0, le=1.0, extra_json_schema=_M)]
"""A standard deviation of the wheels; it may be nothing."""

Angle: TypeAlias = Annotated[float, Meta(ge=0.0, le=pi, extra_json_schema=_RAD)]
"""Between two directions, whichever is first; it may be nothing."""
Turn: TypeAlias = Annotated[float, Meta(ge=1e-4, le=pi, extra_json_schema=_RAD)]
"""Of one step, or between two directions that are tried one after the other."""
Spread: TypeAlias = Annotated[float, Meta(ge=1e-6, le=pi, extra_json_schema=_RAD)]
"""A standard deviation of a direction that weights are made of."""
Heading: TypeAlias = Annotated[float, Meta(ge=-2.0 * pi, le=2.0 * pi, extra_json_schema=_RAD)]
"""A direction, or a turn to either side."""
View: TypeAlias = Annotated[float, Meta(ge=1e-3, le=2.0 * pi, extra_json_schema=_RAD)]
"""What a scanner sees of a full turn."""

Period: TypeAlias = Annotated[float, Meta(ge=1e-3, le=1e9, extra_json_schema=_S)]
"""That something takes."""
Wait: TypeAlias = Annotated[float, Meta(ge=0.0, le=1e9, extra_json_schema=_S)]
"""That may be nothing."""
Speed: TypeAlias = Annotated[float, Meta(ge=1e-3, le=100.0, extra_json_schema=_M_S)]
Pace: TypeAlias = Annotated[float, Meta(ge=0.0, le=100.0, extra_json_schema=_M_S)]
"""A speed that may be nothing."""

Count: TypeAlias = Annotated[int, Meta(ge=1, le=2**31)]
Number: TypeAlias = Annotated[int, Meta(ge=0, le=2**31)]
"""A count that may be nothing."""
Beams: TypeAlias = Annotated[int, Meta(ge=2, le=100_000)]
"""Of a scan."""


def allowed(said: Mapping[str, Any]) -> str:
    """Return in words what a part of a JSON Schema allows: what kind of value, from where to where, in which unit."""
    if "$ref" in said:
        return "an object"
    if "anyOf" in said:
        return " or ".join(allowed(each) for each in said["anyOf"])
    if "enum" in said:
        return f"one of {', '.join(map(str, said['enum']))}"
    if said.get("type") == "array":
        return f"a list{_length(said)}{_entries(said.get('items'))}"
    words = [_KINDS.get(said.get("type", ""), "a value"), _range(said), said.get("unit", "")]
    return " ".join(word for word in words if word)


_KINDS = {
    "number": "a number",
    "integer": "a whole number",
    "string": "text",
    "boolean": "true or false",
    "object": "an object",
    "null": "null",
}


def _range(said: Mapping[str, Any]) -> str:
    least = next((f"{word} {_number(said[key])}" for key, word in _FROM.items() if key in said), "")
    most = next((f"{word} {_number(said[key])}" for key, word in _TO.items() if key in said), "")
    return f"{least} {most}".strip()


def _number(end: int | float) -> str:
    return str(int(end)) if end == int(end) else f"{end:.8g}"


_FROM = {"minimum": "from", "exclusiveMinimum": "above"}
_TO = {"maximum": "to", "exclusiveMaximum": "and below"}


def _length(said: Mapping[str, Any]) -> str:
    least, most = said.get("minItems", 0), said.get("maxItems")
    if most is None:
        return f" of {least} or more" if least else ""
    return f" of {least} to {most}" if least < most else f" of {most}"


def _entries(items: Any) -> str:
    return f", each {allowed(items)}" if items else ""


def fault(group: Any, above: str = "") -> str:
    """Return in words the first value of a group of settings, or of those within, that its field does not allow.

    Empty where there is none. `above` goes before the names of the fields.
    """
    hints = get_type_hints(type(group), include_extras=True)
    for each in fields(group):
        value, hint = getattr(group, each.name), hints[each.name]
        if is_dataclass(value):
            if wrong := fault(value, f"{above}{each.name}."):
                return wrong
        elif not _is_allowed(value, hint):
            return f"{value!r} where {above}{each.name} should be {allowed(schema(hint))}"
    return ""


def _is_allowed(value: Any, hint: Any) -> bool:
    try:
        convert(to_builtins(value, enc_hook=_of_numpy), hint)
    except (ValidationError, NotImplementedError):
        return False
    return True


def _of_numpy(value: Any) -> Any:
    """Return a number of numpy as Python's own."""
    if not isinstance(value, np.generic):
        raise NotImplementedError
    return value.item()
