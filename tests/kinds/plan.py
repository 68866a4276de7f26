"""Two rooms with a door between, of random size: what every drawing of a kind has to come to."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

from chainslam.sim.worlds import DrawingOptions, World, load

from .case import Case, Rng

WALL_M = 0.1


@dataclass(frozen=True)
class Plan:
    """A box from the origin to (w, h), a wall across it at x, and in it a door from low to high; metres."""

    w: float
    h: float
    x: float
    low: float
    high: float

    @property
    def area(self) -> float:
        """The free floor, m2, with walls of 0.1 m."""
        height = self.h - WALL_M
        return (self.w - WALL_M) * height - WALL_M * (height - (self.high - self.low))

    @property
    def lines(self) -> list[tuple[float, float, float, float]]:
        """The walls as lines, whose ends reach half a wall's thickness on."""
        w, h, x, half = self.w, self.h, self.x, WALL_M / 2
        box = [(0.0, 0.0, w, 0.0), (w, 0.0, w, h), (w, h, 0.0, h), (0.0, h, 0.0, 0.0)]
        return [*box, (x, 0.0, x, self.low - half), (x, self.high + half, x, h)]


def plan(rng: Rng) -> Plan:
    """Return one by chance."""
    w, h = float(rng.uniform(6.0, 10.0)), float(rng.uniform(4.0, 7.0))
    low = float(rng.uniform(0.6, h - 2.0))
    values = w, h, float(rng.uniform(2.0, w - 2.0)), low, low + float(rng.uniform(0.8, 1.3))
    return Plan(*(round(value, 2) for value in values))


def drawn(path: Path, content: bytes, area: float, refused: str = "", near: float = 0.02, **said: Any) -> Case:
    """Return the case of a file that has to hold so much free floor, m2, to a share of it; `said` are options."""
    path.write_bytes(content)

    def check(world: World) -> str:
        found = world.free.area
        return "" if abs(found - area) <= near * area else f"{found:.2f} m2 of floor, not {area:.2f}"

    return Case(lambda: load(path, options=DrawingOptions(**said)), check, refused)
