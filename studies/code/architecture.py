"""The rooms of the code as one picture, drawn from the import contracts that `make check` holds and from the imports.

.venv/bin/python -m studies.code.architecture --out docs/pictures/architecture.svg
"""

import textwrap
import tomllib
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import grimp
import tyro
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.patches import FancyArrowPatch, FancyBboxPatch

from chainslam.viz import palette
from chainslam.viz.figures.maps import saved

from .counts import room_of

PLACES = {
    "experiments": (0.0, 7.9, 10.0),
    "viz": (0.0, 4.9, 4.7),
    "sim": (5.3, 4.9, 4.7),
    "explore": (0.0, 0.0, 4.7),
    "slam": (5.3, 0.0, 4.7),
}
"""Left, bottom and width of each room."""
BESIDE = ("explore", "slam")
"""The arrow between these two is level; the other arrows go down."""
ROW, HEAD = 0.36, 0.72
"""Heights of a row of parts and of a room's heading."""


@dataclass(frozen=True)
class Asked:
    """Draw the rooms of the code and what they import."""

    out: Path
    """The picture, an SVG file."""


@dataclass(frozen=True)
class Room:
    """A package, with its parts in layers: a part imports only parts of layers below its own."""

    name: str
    says: str
    """Its docstring."""
    layers: tuple[tuple[str, ...], ...]

    @property
    def top(self) -> float:
        """The height of its upper edge in the picture."""
        return PLACES[self.name][1] + HEAD + ROW * len(self.layers) + 0.1


def rooms(root: Path) -> list[Room]:
    """Return the rooms that have a contract of layers, from pyproject.toml.

    Raises KeyError for a room without a contract.
    """
    contracts = tomllib.loads((root / "pyproject.toml").read_text())["tool"]["importlinter"]["contracts"]
    layers = {room_of(each["containers"][0]): each["layers"] for each in contracts if "containers" in each}
    return [
        Room(
            name,
            (root / name / "__init__.py").read_text().split('"""')[1].strip(),
            tuple(tuple(part.strip() for part in row.split(":")) for row in layers[name]),
        )
        for name in PLACES
    ]


def imports(names: list[str]) -> Counter[tuple[str, str]]:
    """Return for each pair of rooms how many files of the first import something of the second."""
    graph = grimp.build_graph("chainslam", cache_dir=None)
    return Counter(
        (room_of(module), room)
        for module in graph.modules
        for room in {room_of(found) for found in graph.find_modules_directly_imported_by(module)}
        if room != room_of(module) and {room, room_of(module)} <= set(names)
    )


def draw(found: list[Room], arrows: Counter[tuple[str, str]]) -> Figure:
    """Return the picture of these rooms; what no arrow can show without crossing a room is told below."""
    figure = Figure(figsize=(8.0, 10.2), layout="constrained")
    axes = figure.subplots()
    axes.set_axis_off()
    axes.set_aspect("equal")
    by_name = {room.name: room for room in found}
    for room in found:
        _paint(axes, room)
    told = []
    for (importer, imported), count in sorted(arrows.items()):
        if not _arrow(axes, by_name[importer], by_name[imported], count):
            told.append(f"{importer} → {imported}: {count}")
    axes.text(
        5.0, -0.3, "Numbers: files that import from there. Not drawn: " + ", ".join(told), fontsize=7, ha="center"
    )
    axes.set_xlim(-0.1, 10.1)
    axes.set_ylim(-0.5, by_name["experiments"].top + 0.1)
    return figure


def _paint(axes: Axes, room: Room) -> None:
    left, bottom, width = PLACES[room.name]
    axes.add_patch(_box(left, bottom, width, room.top - bottom, palette.FLOOR, palette.INK))
    axes.text(left + 0.15, room.top - 0.2, f"{room.name}/", weight="bold", fontsize=10, va="center")
    says = textwrap.fill(room.says, int(14 * width))
    axes.text(left + 0.15, room.top - 0.35, says, fontsize=6.5, va="top", color=palette.INK)
    for k, row in enumerate(room.layers):
        low, cell = room.top - HEAD - ROW * (k + 1), (width - 0.2) / len(row)
        for j, part in enumerate(row):
            axes.add_patch(
                _box(left + 0.13 + j * cell, low + 0.05, cell - 0.06, ROW - 0.1, "white", palette.GRID_STRONG)
            )
            axes.text(left + 0.1 + (j + 0.5) * cell, low + ROW / 2, part, fontsize=7.5, ha="center", va="center")


def _arrow(axes: Axes, importer: Room, imported: Room, count: int) -> bool:
    """Draw an arrow between rooms that stand next to each other; return whether they do."""
    (left, bottom, width), (other_left, _, other_width) = PLACES[importer.name], PLACES[imported.name]
    overlap = max(left, other_left), min(left + width, other_left + other_width)
    middle = sum(overlap) / 2
    if (importer.name, imported.name) == BESIDE:
        start, end, words = (left + width, 1.5), (other_left, 1.5), (middle, 1.65)
    elif overlap[1] > overlap[0] and 0 < bottom - imported.top < 1.5:
        start, end, words = (middle, bottom), (middle, imported.top), (middle + 0.3, (bottom + imported.top) / 2)
    else:
        return False
    axes.add_patch(
        FancyArrowPatch(start, end, arrowstyle="-|>", mutation_scale=14, color=palette.INK, shrinkA=0, shrinkB=0)
    )
    axes.text(*words, str(count), fontsize=8, ha="center", va="center")
    return True


def _box(left: float, bottom: float, width: float, height: float, face: str, edge: str) -> FancyBboxPatch:
    style = "round,pad=0,rounding_size=0.06"
    return FancyBboxPatch((left, bottom), width, height, boxstyle=style, facecolor=face, edgecolor=edge, linewidth=0.8)


def main() -> int:
    """Draw the picture."""
    asked = tyro.cli(Asked, prog="studies.code.architecture")
    asked.out.parent.mkdir(parents=True, exist_ok=True)
    asked.out.write_bytes(saved(draw(rooms(Path()), imports(list(PLACES))), asked.out.suffix[1:]))  # type: ignore[arg-type]
    return 0


if __name__ == "__main__":
    raise SystemExit(main())
