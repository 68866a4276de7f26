"""How much memory each back end takes, by the lines of its map and by its steps."""

import itertools
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from resource import getpagesize

import numpy as np
import tyro
from rich.table import Table

from slam.backend import Backend, Observations
from slam.backends import BACKENDS
from slam.geometry.lines import directions, normals
from slam.robot import Odometry

from .console import plain_console
from .scenario import UsageError, choose

SEEN = 10
_FEW = 12
"""Lines and steps of a run before the first measurement, so that code and libraries are loaded by then."""


@dataclass(frozen=True)
class Study:
    """Fill maps, see ten lines at each step, and print by how much the process has grown, MB."""

    backends: tuple[str, ...] = tuple(name for name in BACKENDS if name != "graph-batch")
    """The estimators."""
    lines: tuple[int, ...] = (50, 200, 750)
    """Lines of the map."""
    steps: tuple[int, ...] = (100, 1000)
    """Steps driven."""

    def run(self) -> None:
        """Run the study and print a row for each back end; raises UsageError."""
        for name in self.backends:
            choose("back end", name, BACKENDS)
        if min(self.lines) < SEEN or min(self.steps) < 1:
            raise UsageError(f"expected at least {SEEN} lines and a step, found {self.lines}, {self.steps}: raise them")
        kinds = list(itertools.product(self.lines, self.steps))
        table = Table("back end", *(f"{n} lines, {k} steps" for n, k in kinds), title="memory, MB")
        for name in self.backends:
            # A new process for each: what one has freed would hide what the next one takes.
            with ProcessPoolExecutor(1, get_context("spawn"), max_tasks_per_child=1) as pool:
                grown = [pool.submit(megabytes, name, *kind).result() for kind in kinds]
            table.add_row(name, *(f"{mb:.1f}" for mb in grown))
        plain_console(width=max(plain_console().width, 120)).print(table)


def megabytes(name: str, lines: int, steps: int) -> float:
    """Return by how much this process grows when a map of so many lines is made and driven in for so many steps."""
    _drive(name, _FEW, _FEW)
    before = _resident()
    kept = _drive(name, lines, steps)
    after = _resident()
    assert len(kept.belief.ids) == lines
    return (after - before) / 1e6


def _drive(name: str, lines: int, steps: int) -> Backend:
    rng = np.random.default_rng(0)
    alpha, r = rng.uniform(-np.pi, np.pi, lines), rng.uniform(1.0, 4.0, lines)
    t0 = rng.uniform(-1.0, 1.0, lines)
    turn = np.tile(np.eye(2), (lines, 1, 1))
    turn[:, 1, 0] = t0
    cov = turn @ np.diag([1e-4, 1e-5]) @ turn.swapaxes(1, 2)
    seen = np.stack([alpha, r], axis=-1)
    backend = BACKENDS[name].make(np.zeros(3), np.diag([1e-4, 1e-4, 1e-6]))
    ids = backend.grow(seen, cov, r[:, None] * normals(alpha) + t0[:, None] * directions(alpha))
    noise = np.array([0.01, 0.005, 0.005])
    for _ in range(steps):
        backend.predict(Odometry(np.zeros(3), np.diag(noise**2)))
        rows = np.sort(rng.choice(lines, SEEN, replace=False))
        observed = Observations(ids[rows], seen[rows], cov[rows])
        backend.update(observed, observed)
        backend.belief.joint(ids[rows])
    return backend


def _resident() -> int:
    return int(Path("/proc/self/statm").read_text().split()[1]) * getpagesize()


if __name__ == "__main__":
    try:
        tyro.cli(Study).run()
    except UsageError as error:
        raise SystemExit(f"memory_study: {error}") from error
