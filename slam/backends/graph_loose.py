"""Which sightings of a factor graph must be linearised anew, because the direction of their line was poorly known."""

from dataclasses import dataclass, field
from math import atan2, cos, sin, sqrt

from .graph_record import Seen


def wrapped(angle: float) -> float:
    """Return one angle rad brought into [-pi, pi]."""
    return atan2(sin(angle), cos(angle))


@dataclass
class _Line:
    information: float
    """Of the line's direction, 1/rad^2."""
    alpha: float
    """Direction of the line when its sightings were last linearised."""
    turn: float
    """How far the line may turn before they are linearised anew, rad."""
    numbers: list[int] = field(default_factory=list)


class Loose:
    """The sightings that a turn of their line would put wrong by more than `tolerance` of their sigma.

    The distance of a seen piece from its line changes with the square of the angle between the two, times its
    distance from the robot; the factor knows the change to first order alone. Once a line's direction is known well
    enough, nothing can turn it so far, and its later sightings are of no concern.
    """

    def __init__(self, tolerance: float) -> None:
        self._tolerance = tolerance
        self._lines: dict[int, _Line] = {}
        self._touched: set[int] = set()

    def note(self, line: int, number: int, seen: Seen, alpha: float, again: bool) -> None:
        """Note a sighting of a line whose direction is `alpha` now; `again` if it was noted before."""
        _, r, along, cross, across = seen
        turn = sqrt(2.0 * self._tolerance * sqrt(across - cross * cross / along) / max(abs(r), 1e-3))
        at = self._lines.setdefault(line, _Line(0.0, alpha, turn))
        at.information += 0.0 if again else 1.0 / along
        if 9.0 / at.information > turn * turn:
            at.turn = min(at.turn, turn) if at.numbers else turn
            at.numbers.append(number)
        if at.numbers:
            self._touched.add(line)

    def leave(self, line: int, number: int) -> None:
        """Forget a sighting."""
        if line in self._lines and number in self._lines[line].numbers:
            self._lines[line].numbers.remove(number)

    def drop(self, line: int) -> None:
        """Forget a line."""
        self._lines.pop(line, None)
        self._touched.discard(line)

    def touched(self) -> list[int]:
        """Return the lines with loose sightings that were seen since `calm`."""
        return sorted(self._touched)

    def calm(self) -> None:
        """Take all lines as looked after."""
        self._touched.clear()

    def turned(self, line: int, alpha: float) -> list[int]:
        """Return, and take out, the sightings that the line's new direction puts wrong."""
        at = self._lines[line]
        if not at.numbers or abs(wrapped(alpha - at.alpha)) <= at.turn:
            return []
        numbers, at.numbers, at.alpha = at.numbers, [], alpha
        return numbers
