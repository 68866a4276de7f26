"""The reproduction of one of the paper's figures: its picture, and numbers next to the paper's."""

from collections.abc import Callable, Mapping
from dataclasses import dataclass
from typing import Any

from matplotlib.figure import Figure

Value = float | int | str | None
"""None if there is nothing to measure."""
Numbers = dict[str, dict[str, Value]]
"""Quantities of each back end, or variant of one."""
Said = Mapping[str, Value]
"""The paper's values, for those quantities that it reports."""


@dataclass(frozen=True)
class Reproduction:
    """Numbers by quantity (with its unit in the name) and the picture."""

    title: str
    paper: Said
    ours: Mapping[str, Mapping[str, Value]]
    """Quantities of each back end, or variant of one."""
    figure: Figure
    notes: tuple[str, ...] = ()
    """Notes for the reader of the numbers."""

    @property
    def quantities(self) -> tuple[str, ...]:
        """All quantities in order, ours first."""
        names = [name for values in self.ours.values() for name in values]
        return tuple(dict.fromkeys([*names, *self.paper]))

    def record(self, command: str) -> dict[str, Any]:
        """Return the content of the JSON file, with the command that makes it."""
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
    """Results of one drive with a seed, for tables over many seeds."""
    paper: Said
    about: str
