"""What the reproduction of one of the paper's figures is: its picture, and the numbers beside the paper's."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

Value = float | int | str | None
"""None where there is nothing to measure."""
Numbers = dict[str, dict[str, Value]]
"""For each back end (or variant of one) its quantities."""
Said = Mapping[str, Value]
"""What the paper says, for those quantities of which it says something."""


@dataclass(frozen=True)
class Reproduction:
    """Numbers by quantity (its unit in its name) and the picture."""

    title: str
    paper: Said
    ours: Mapping[str, Mapping[str, Value]]
    """For each back end (or variant of one) its quantities."""
    figure: Figure
    notes: tuple[str, ...] = ()
    """What a reader of the numbers has to know."""

    @property
    def quantities(self) -> tuple[str, ...]:
        """All quantities, ours first, in the order in which they come."""
        names = [name for values in self.ours.values() for name in values]
        return tuple(dict.fromkeys([*names, *self.paper]))

    def record(self, command: str) -> dict[str, Any]:
        """Return what goes into the JSON file, with the command that makes it."""
        return {
            "title": self.title,
            "command": command,
            "paper": dict(self.paper),
            "ours": {name: dict(values) for name, values in self.ours.items()},
            "notes": list(self.notes),
        }


@dataclass(frozen=True)
class Entry:
    """How to reproduce a figure with a seed, and what it shows."""

    make: Callable[[int], Reproduction]
    numbers: Callable[[int], Numbers]
    """What one drive with a seed gives, for tables over many seeds."""
    paper: Said
    about: str
