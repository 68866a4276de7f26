"""Equation (4): the effect of the position of the world's origin on the errors of a map.

r changes with alpha by the lever arm to the point that r is measured from. If it is measured from the world's origin,
as in the paper, the same drive gives another map when the origin is 100 m away; if it is measured from the wall, it
does not.
"""

from dataclasses import dataclass, replace
from typing import Any

import numpy as np
import tyro
from jaxtyping import Float
from rich.table import Table

from chainslam.slam.backends.blocks.block_ekf import BlockEkf
from chainslam.slam.backends.fej_ekf import FejEkf
from chainslam.slam.backends.full_ekf import FullEkf
from chainslam.slam.backends.invariant_ekf import InvariantEkf
from chainslam.slam.backends.kalman.config import EkfConfig
from chainslam.slam.backends.relocation_ekf import RelocationEkf
from chainslam.slam.estimation.backend import Backend
from chainslam.slam.geometry.lines import normals

from ...replays.corridor import Loop, drive
from ...replays.observations import DriveObservations, ride
from ...scenario import P0, P0_SIGMAS, drawn_start
from ...terminal.console import plain_console
from ...usage import choose

FILTERS: tuple[type[Any], ...] = (BlockEkf, RelocationEkf, FullEkf, FejEkf, InvariantEkf)


@dataclass(frozen=True)
class ShiftedOrigin:
    """Drive the same loop near the origin and far from it, with lines anchored at their walls and at the origin."""

    shift_m: tuple[float, float] = (100.0, 0.0)
    """Displacement of the world."""
    length_m: float = 60.0
    """Length of the ring of corridors."""
    seeds: int = 20
    """Number of rings."""
    first_seed: int = 1
    """Seed of the first ring; the others follow it."""
    p0: P0 = "small"
    """Standard deviations of the initial pose."""

    def run(self) -> None:
        """Run the study and print a row for each filter and anchor; raises UsageError."""
        choose("start covariance (--p0)", self.p0, P0_SIGMAS)
        table = Table("filter", "anchor", "pose ANEES", "moved", "path differs by", "broke down")
        table.title = f"rings of {self.length_m:g} m, moved by {self.shift_m} m"
        for kind in FILTERS:
            for at_wall in (True, False):
                anchor = "its wall" if at_wall else "the origin"
                seeds = range(self.first_seed, self.first_seed + self.seeds)
                found = np.array([self.ridden(kind, at_wall, seed) for seed in seeds])
                sound = found[np.isfinite(found).all(axis=1)]
                if not len(sound):
                    table.add_row(kind.__name__, anchor, "-", "-", "-", str(len(found)))
                    continue
                here, there, apart = sound[:, 0].mean(), sound[:, 1].mean(), sound[:, 2].max()
                row = f"{here:.3f}", f"{there:.3f}", f"{apart:.2g} m", str(len(found) - len(sound))
                table.add_row(kind.__name__, anchor, *row)
        plain_console(width=max(plain_console().width, 90)).print(table)

    def ridden(self, kind: type[Any], at_wall: bool, seed: int) -> tuple[float, float, float]:
        """Return the pose ANEES here and there and how far apart the paths are, m; NaN where one breaks down."""
        seen = drive(Loop(self.length_m, after_m=10.0), seed)
        shift = np.array(self.shift_m)

        def make(by: Float[np.ndarray, "2"]) -> Backend:
            pose, cov = drawn_start(seen.chance, seen.true_poses_world[0], self.p0)
            backend: Backend = kind(pose + np.append(by, 0.0), cov, EkfConfig(at_wall=at_wall))
            return backend

        try:
            here, there = ride(make(np.zeros(2)), seen), ride(make(shift), moved(seen, shift))
            apart = np.abs(there.estimated_world[:, :2] - shift - here.estimated_world[:, :2]).max()
            return float(here.pose_nees.mean()) / 3.0, float(there.pose_nees.mean()) / 3.0, float(apart)
        except np.linalg.LinAlgError:
            return np.nan, np.nan, np.nan


def moved(seen: DriveObservations, shift: Float[np.ndarray, "2"]) -> DriveObservations:
    """Return the same drive in a displaced world; the reports of the robot stay the same."""
    lines = {wall: line + np.array([0.0, normals(line[:1])[0] @ shift]) for wall, line in seen.true_lines_world.items()}
    return replace(seen, true_poses_world=seen.true_poses_world + np.append(shift, 0.0), true_lines_world=lines)


if __name__ == "__main__":
    tyro.cli(ShiftedOrigin).run()
