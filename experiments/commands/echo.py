"""What was understood of a world, told before anything is computed in it."""

import numpy as np

from sim.worlds import World

from ..terminal.console import say


def echo_world(world: World) -> None:
    """Print on standard output how large a world is, what was read from its file, and what was assumed."""
    for line in world_lines(world):
        say(line)


def world_lines(world: World) -> tuple[str, ...]:
    """Return a world in two lines: size and understanding; start and scale with who said so."""
    x0, y0, x1, y1 = world.free.bounds
    size = f"{x1 - x0:.1f} x {y1 - y0:.1f} m, {world.free.area:.1f} m2 of floor, {len(world.faces)} walls"
    x, y, heading = world.start
    start = f"({x:.2f}, {y:.2f}) m, {np.rad2deg(heading):.0f} degrees"
    if world.reading is None:
        return (f"world {world.name}: {size}; start {start}",)
    understood = f"; understood {world.reading.understood}" if world.reading.understood else ""
    return (
        f"world {world.name}: {size}{understood}",
        f"start {start}, {world.reading.start}; scale {world.reading.scale}",
    )
