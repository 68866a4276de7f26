"""What is printed before a run: how the world was read, and how long the run will probably take."""

from collections.abc import Iterable

import numpy as np

from chainslam.sim.worlds import World

from ..scenario import TrialConfig
from ..terminal.console import say

STEPS = 3.6, 1.27
"""Steps of a run, c n^p for n walls: over 86 stored runs (studies/results/rows; 6 bundled worlds, 70 apartments)."""
STEPS_A_METRE, STEPS_A_M2 = 3.4, 2.2
"""But at least this many per metre of wall and per m2 of floor: corridors and halls have few walls and long paths."""
STEPS_SPREAD = 0.6, 2.5
"""The shortest and the longest of these runs, without the extreme 2 %, relative to STEPS."""
DRIVING_S = 0.25, 0.42
"""Driving time per step in them."""
COMPUTING_S = 0.005, 0.03
"""Computing time per step: in runs in schools on an idle machine, and on a busy one."""
SLOW = {"graph": 1.6, "graph-batch": 1.6}
"""Factor on the computing time of back ends that are slower than filters."""


def echo_world(world: World) -> None:
    """Print the size of a world, how its file was read, and what was assumed."""
    for line in world_lines(world):
        say(line)


def world_lines(world: World) -> tuple[str, ...]:
    """Return a description of a world: size and interpretation; start and scale with their sources; notes."""
    x0, y0, x1, y1 = world.free.bounds
    size = f"{x1 - x0:.1f} x {y1 - y0:.1f} m, {world.free.area:.1f} m2 of floor, {len(world.faces)} walls"
    x, y, heading = world.start
    # Adding zero makes -0 a plain 0.
    x, y, degrees = (round(value, digits) + 0.0 for value, digits in ((x, 2), (y, 2), (np.rad2deg(heading), 0)))
    start = f"({x:.2f}, {y:.2f}) m, {degrees:.0f} degrees"
    if world.reading is None:
        return (f"world {world.name}: {size}; start {start}",)
    understood = f"; understood {world.reading.understood}" if world.reading.understood else ""
    return (
        f"world {world.name}: {size}{understood}",
        f"start {start}, {world.reading.start}; scale {world.reading.scale}",
        *(f"note: {words}" for words in world.reading.notes),
    )


def expected_steps(world: World, most: int) -> tuple[float, float]:
    """Return the range of the number of steps that a run will probably take, up to its limit."""
    by_walls = STEPS[0] * max(len(world.faces), 1) ** STEPS[1]
    length_m = float(np.linalg.norm(world.faces[:, 1] - world.faces[:, 0], axis=1).sum())
    middle = max(by_walls, STEPS_A_METRE * length_m, STEPS_A_M2 * world.free.area)
    low, high = (min(spread * middle, float(most)) for spread in STEPS_SPREAD)
    return low, high


def expected_computing_s(world: World, backend: str, most: int) -> tuple[float, float]:
    """Return the range of the computing time, s, that a run will probably take."""
    low, high = expected_steps(world, most)
    slow = SLOW.get(backend, 1.0)
    return COMPUTING_S[0] * slow * low, COMPUTING_S[1] * slow * high


def run_line(world: World, trial: TrialConfig) -> str:
    """Return an estimate of the steps, driving time and computing time of a run, in one line."""
    low, high = expected_steps(world, trial.max_steps)
    driving = DRIVING_S[0] * low, DRIVING_S[1] * high
    computing = expected_computing_s(world, trial.backend, trial.max_steps)
    return (
        f"expected, roughly: {_range(*(f'{_rounded(n):,}' for n in (low, high)))} steps; driving time"
        f" {_range(*map(_about, driving))}, computing time {_range(*map(_about, computing))}"
    )


def campaign_line(runs: Iterable[tuple[World, str]], recorded: int, most: int, processes: int | None) -> str:
    """Return an estimate of the computing time of many runs, each given by its world and back end, in one line.

    Of these, `recorded` are only driven to be replayed.
    """
    each = [expected_computing_s(world, backend, most) for world, backend in runs]
    low, high = (sum(column) / (processes or 1) for column in zip(*each, strict=True))
    where = "summed over all workers" if processes is None else f"on {processes} process{'es' if processes > 1 else ''}"
    also = f", {recorded} of them recordings for the replays" if recorded else ""
    return f"expected, roughly: {len(each)} trials{also}; computing time {_range(_about(low), _about(high))} {where}"


def _range(low: str, high: str) -> str:
    return low if low == high else f"{low} to {high}"


def _rounded(value: float) -> int:
    """Return a number rounded to two significant digits."""
    return int(float(f"{value:.2g}"))


def _about(seconds: float) -> str:
    for unit, size in (("h", 3600.0), ("min", 60.0)):
        if seconds >= 1.5 * size:
            return f"{_rounded(seconds / size):,} {unit}"
    return f"{max(_rounded(seconds), 1)} s"
