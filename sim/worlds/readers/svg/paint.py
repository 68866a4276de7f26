"""Paint: how light it is and how much of what lies below shows through."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import tinycss2
from tinycss2 import color5

DARK = 0.7
"""What is darker than this on a white page reads as drawn."""
SYSTEM = {"canvas": 1.0, "canvastext": 0.0, "window": 1.0, "windowtext": 0.0}
"""Lightness of the colours that a viewer chooses itself, on a light page."""


@dataclass(frozen=True)
class Paint:
    """A colour as far as a plan cares."""

    lightness: float
    alpha: float

    def faded(self, opacity: float) -> "Paint":
        """Return the paint seen through so much opacity."""
        return Paint(self.lightness, self.alpha * opacity)

    @property
    def is_dark(self) -> bool:
        """Whether it reads as drawn on a white page."""
        return self.lightness * self.alpha + 1 - self.alpha < DARK

    @property
    def hides(self) -> bool:
        """Whether something black below reads as blank."""
        return self.lightness * self.alpha >= DARK


NOTHING = Paint(1.0, 0.0)
BLACK = Paint(0.0, 1.0)


@dataclass(frozen=True)
class Server:
    """A reference to a gradient or a pattern, and the paint where there is none of that id."""

    id: str
    otherwise: Paint


def paint_of(tokens: Sequence[Any], current: Callable[[], Paint]) -> Paint | Server | None:
    """Return the paint in a value of `fill` or `stroke`, `current` being that of `color`; None for no such value."""
    given = [token for token in tokens if token.type not in ("whitespace", "comment")]
    if given and given[0].type in ("url", "function") and (target := url_of(given[0])) is not None:
        rest = paint_of(given[1:], current) if len(given) > 1 else NOTHING
        return Server(target, rest) if isinstance(rest, Paint) else None
    # SVG 1.1 lets a colour profile's own colour follow, which no viewer takes today.
    if len(given) == 2 and getattr(given[1], "lower_name", "") == "icc-color":
        given = given[:1]
    if len(given) != 1:
        return None
    word = given[0].lower_value if given[0].type == "ident" else ""
    if word == "none":
        return NOTHING
    if word == "currentcolor":
        return current()
    return Paint(SYSTEM[word], 1.0) if word in SYSTEM else _colour(given[0])


def _colour(token: Any) -> Paint | None:
    try:
        colour = color5.parse_color(tinycss2.serialize([token]), ("light",))
        if colour is None or isinstance(colour, str):
            return None
        alpha = min(max(float(colour.alpha), 0.0), 1.0)
        if colour.space in ("hsl", "hwb"):
            colour = colour.to("srgb")
        if colour.space in ("srgb", "display-p3"):
            red, green, blue = (min(max(float(part or 0.0), 0.0), 1.0) for part in colour.coordinates)
            return Paint(0.299 * red + 0.587 * green + 0.114 * blue, alpha)
        # The L of CIE Lab is within 0.03 of the value of a grey of sRGB.
        return Paint(min(max(float(colour.to("lab").coordinates[0]) / 100, 0.0), 1.0), alpha)
    except (ValueError, NotImplementedError, OverflowError):
        # `color()` of no space, a space that the parser cannot convert, numbers beyond all bounds.
        return None


def url_of(token: Any) -> str | None:
    """Return the id that `url(#id)` names, empty for another file's; None for another token."""
    if token.type == "url":
        text = token.value
    elif token.type == "function" and token.lower_name == "url":
        text = "".join(str(getattr(part, "value", "")) for part in token.arguments)
    else:
        return None
    text = text.strip()
    return text[1:] if text.startswith("#") else ""
