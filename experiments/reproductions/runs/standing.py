"""A robot that stands still and observes the same walls: how much each back end claims to learn about its pose.

No observation locates the world, so the covariance of the pose must not fall below the transported initial covariance,
A P0 A' with A = [I, J (p - p0); 0, 1] (docs/concepts/consistency.md). The paper's figures 10 and 11 show one that does.
"""

from dataclasses import dataclass

import numpy as np
import tyro
from jaxtyping import Float
from rich.table import Table

from chainslam.sim.chance import Chance, Channel, world_key
from chainslam.slam.backends import BACKENDS
from chainslam.slam.estimation.backend import Observations
from chainslam.slam.geometry.lines import through
from chainslam.slam.geometry.poses import J

from ...replays.corridor import look, on_ring, ring
from ...scenario import P0, P0_SIGMAS, drawn_start
from ...terminal.console import plain_console
from ...usage import UsageError, choose

MARKS = (10, 100, 1000)


@dataclass(frozen=True)
class StandingStill:
    """Observe the same walls again and again, and print how certain each back end becomes of its pose."""

    backends: tuple[str, ...] = tuple(name for name in BACKENDS if name != "graph-batch")
    """Estimators."""
    p0: tuple[P0, ...] = ("large", "small")
    """Standard deviations of the initial pose."""
    looks: int = 1000
    """Number of observations."""
    seed: int = 1
    """Seed of the noise and the walls."""

    def run(self) -> None:
        """Run the study and print a row for each back end; raises UsageError."""
        for name in self.backends:
            choose("back end", name, BACKENDS)
        marks = [mark for mark in MARKS if mark <= self.looks]
        if not marks:
            raise UsageError(f"expected at least {MARKS[0]} looks, found {self.looks}: raise --looks")
        for p0 in self.p0:
            choose("start covariance (--p0)", p0, P0_SIGMAS)
            columns = (*(f"after {mark}" for mark in marks), "slope", "P - A P0 A'")
            table = Table("back end", *columns, title=f"trace of P over that of P0, P0 {p0}")
            for name in self.backends:
                trace, bound = stand(name, p0, self.looks, self.seed)
                cells = [f"{trace[mark - 1]:.4g}" for mark in marks]
                table.add_row(name, *cells, f"{slope(trace):.3f}", f"{bound.min():.1e}")
            plain_console(width=max(plain_console().width, 100)).print(table)
        print("slope: of the trace over the number of observations, log-log, from the tenth on; last column: least")
        print("eigenvalue after any of them, over the trace of P0, with A at the estimate")


def stand(name: str, p0: str, looks: int, seed: int) -> tuple[Float[np.ndarray, " n"], Float[np.ndarray, " n"]]:
    """Return, after each observation, tr P / tr P0 and the least eigenvalue of P - A P0 A' over tr P0."""
    walls = ring(40.0, np.random.default_rng(seed))
    lines = through(walls)
    # Where most walls are visible: from parallel walls alone the position along them is unobservable.
    true = max(on_ring(np.arange(0.0, 10.0, 0.25), 40.0), key=lambda p: len(look(walls, lines, p, 0.0 * lines)))
    chance = Chance(seed, world_key(walls, true))
    draws = [chance.standard_normals(Channel.LASER, k, 2 * len(walls)).reshape(-1, 2) for k in range(looks + 1)]
    begin, cov = drawn_start(chance, true, p0)
    backend = BACKENDS[name].make(begin.copy(), cov.copy())
    seen = look(walls, lines, true, draws[-1])
    ids = backend.grow(seen.lines, seen.cov, seen.centres)
    trace, bound = np.empty(looks), np.empty(looks)
    for k in range(looks):
        seen = look(walls, lines, true, draws[k])
        observed = Observations(ids, seen.lines, seen.cov)
        backend.update(observed, observed)
        belief = backend.belief
        A = np.eye(3)
        A[:2, 2] = J @ (belief.pose_world[:2] - begin[:2])
        trace[k] = np.trace(belief.pose_cov) / np.trace(cov)
        bound[k] = np.linalg.eigvalsh(belief.pose_cov - A @ cov @ A.T).min() / np.trace(cov)
    return trace, bound


def slope(trace: Float[np.ndarray, " n"]) -> float:
    """Return the slope of the trace over the number of observations, from the tenth on: -1 is like 1/n."""
    n = np.arange(1, len(trace) + 1)
    return float(np.polyfit(np.log(n[9:]), np.log(trace[9:]), 1)[0]) if len(trace) > 10 else float("nan")


if __name__ == "__main__":
    try:
        tyro.cli(StandingStill).run()
    except UsageError as error:
        raise SystemExit(f"standing_study: {error}") from error
