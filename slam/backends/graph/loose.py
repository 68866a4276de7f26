"""Which observations of a factor graph must be linearised anew, because their line turned after they were entered."""

from collections.abc import Collection
from dataclasses import dataclass, field
from math import atan2, cos, sin, sqrt

from .record import Seen


def wrapped(angle: float) -> float:
    """Return one angle rad brought into [-pi, pi]."""
    return atan2(sin(angle), cos(angle))


@dataclass
class _Line:
    information: float
    """Of the line's direction, 1/rad^2."""
    alpha: float
    """Direction of the line when its loose observations were last looked after."""
    turn: float
    """How far the line may turn before they are looked after again, rad."""
    numbers: list[int] = field(default_factory=list)
    """The loose observations."""


class Loose:
    """The observations that a turn of their line would put wrong by more than `tolerance` of their sigma.

    The distance of a seen piece from its line changes with the square of the angle between the two, times its
    distance from the robot; the factor knows the change to first order alone. Once a line's direction is known well
    enough nothing can turn it so far, and its observations need looking after once, when they are new.
    """

    def __init__(self, tolerance: float, sigmas: float) -> None:
        self._tolerance, self._sigmas = tolerance, sigmas
        self._lines: dict[int, _Line] = {}
        self._touched: dict[int, list[int]] = {}

    def turn(self, seen: Seen) -> float:
        """Return by how much the angle between an observation and its line may change, rad."""
        _, r, along, cross, across = seen
        return sqrt(2.0 * self._tolerance * sqrt(across - cross * cross / along) / max(abs(r), 1e-3))

    def note(self, line: int, number: int, seen: Seen, alpha: float, again: bool) -> None:
        """Note an observation of a line whose direction is `alpha` now; `again` if it was noted before."""
        turn = self.turn(seen)
        at = self._lines.setdefault(line, _Line(0.0, alpha, turn))
        at.information += 0.0 if again else 1.0 / seen[2]
        self._touched.setdefault(line, []).append(number)
        if self._sigmas**2 / at.information > turn * turn:
            at.turn = min(at.turn, turn) if at.numbers else turn
            at.numbers.append(number)

    def leave(self, line: int, number: int) -> None:
        """Forget an observation."""
        if line in self._lines and number in self._lines[line].numbers:
            self._lines[line].numbers.remove(number)

    def drop(self, line: int) -> None:
        """Forget a line."""
        self._lines.pop(line, None)
        self._touched.pop(line, None)

    def touched(self, more: Collection[int] = ()) -> dict[int, list[int]]:
        """Return the lines seen since `calm` and `more`, with the observations that are new since it was last asked."""
        touched = {line: self._touched.get(line, []) for line in sorted({*self._touched, *more})}
        self._touched = {line: [] for line in touched}
        return touched

    def calm(self) -> None:
        """Take all lines as looked after."""
        self._touched.clear()

    def suspects(self, line: int, new: list[int], alpha: float, anew: bool) -> list[int]:
        """Return the observations to look after now that the line has direction `alpha`.

        The new, and all the loose where it turned far or is linearised `anew`.
        """
        at = self._lines[line]
        if not at.numbers or (not anew and abs(wrapped(alpha - at.alpha)) <= at.turn):
            return new
        at.alpha = alpha
        return sorted({*at.numbers, *new})
