"""A room of lines and a noisy drive through it: what any back end can be fed with."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from ...estimation.backend import Backend, Observations
from ...geometry.lines import directions, normals
from ...geometry.poses import compose, rotation, to_robot, wrap
from ...robot import Odometry

Make = Callable[[Float[np.ndarray, "3"], Float[np.ndarray, "3 3"]], Backend]
"""Makes a back end at a pose, world frame, with its covariance and an empty map."""
Looks = tuple[Float[np.ndarray, "m 2"], Float[np.ndarray, "m 2 2"], Float[np.ndarray, "m 2"]]
"""Lines, covariances and centres, robot frame."""
NOWHERE = np.zeros(3)
START, P0 = np.array([0.5, -0.3, 0.2]), np.diag([0.01, 0.01, 0.002]) ** 2
ALONG_RAD, ACROSS_M = 0.004, 0.003
WHEELS = np.array([0.01, 0.005, 0.008])
"""Sigmas of a step, m, m and rad."""


@dataclass(frozen=True)
class Room:
    """True lines (alpha, r) with the points where they are looked at."""

    lines: Float[np.ndarray, "n 2"]
    points: Float[np.ndarray, "n 2"]

    @classmethod
    def random(cls, rng: np.random.Generator, count: int = 8) -> "Room":
        """Return walls around the origin."""
        alpha, r = rng.uniform(-np.pi, np.pi, count), rng.uniform(2.0, 6.0, count)
        points = r[:, None] * normals(alpha) + rng.uniform(-1, 1, (count, 1)) * directions(alpha)
        return cls(np.stack([alpha, r], axis=-1), points)

    def seen(
        self, pose: Float[np.ndarray, "3"], rows: Int[np.ndarray, " m"], rng: np.random.Generator | None = None
    ) -> Looks:
        """Return how some walls look from a pose, noisy with a generator."""
        centres = to_robot(self.points[rows], pose)
        alpha = self.lines[rows, 0] - pose[2]
        r = self.lines[rows, 1] - normals(self.lines[rows, 0]) @ pose[:2]
        turn = np.tile(np.eye(2), (len(rows), 1, 1))
        turn[:, 1, 0] = np.vecdot(centres, directions(alpha))
        cov = turn @ np.diag([ALONG_RAD**2, ACROSS_M**2]) @ turn.swapaxes(1, 2)
        lines = np.stack([wrap(alpha), r], axis=-1)
        if rng is not None:
            lines = lines + np.einsum("mij,mj->mi", np.linalg.cholesky(cov), rng.standard_normal((len(rows), 2)))
        return lines, cov, centres


def driven(
    rng: np.random.Generator, true: Float[np.ndarray, "3"], forward: float = 0.1, turn: float = 0.15
) -> tuple[Odometry, Float[np.ndarray, "3"]]:
    """Return what the wheels report of a step, and the true pose after it."""
    odometry = Odometry(np.array([forward, 0.0, turn]), np.diag(WHEELS) ** 2)
    return odometry, compose(true, odometry.motion + WHEELS * rng.standard_normal(3))


def see(backend: Backend, ids: Int[np.ndarray, " m"] | list[int], looks: Looks) -> None:
    """Let a back end take in a scan's looks, the same before relocation and after."""
    observed = Observations(np.asarray(ids, dtype=np.int64), looks[0], looks[1])
    backend.update(observed, observed)


@dataclass
class Journey:
    """A noisy circle through a room; every wall is entered when it is first seen."""

    backend: Backend
    room: Room
    true: Float[np.ndarray, "3"]
    ids: dict[int, int]
    """Wall to line."""

    def drive(self, steps: int, rng: np.random.Generator, backwards: bool = False) -> "Journey":
        """Drive on, with two to five walls in sight of each step, told in one order or the other."""
        for _ in range(steps):
            odometry, self.true = driven(rng, self.true)
            self.backend.predict(odometry)
            rows = np.sort(rng.choice(len(self.room.lines), rng.integers(2, 6), replace=False))
            looks = self.room.seen(self.true, rows, rng)
            known = np.flatnonzero([row in self.ids for row in rows])[:: -1 if backwards else 1]
            if len(known):
                ids = [self.ids[row] for row in rows[known].tolist()]
                see(self.backend, ids, (looks[0][known], looks[1][known], looks[2][known]))
            new = np.flatnonzero([row not in self.ids for row in rows])
            if len(new):
                grown = self.backend.grow(*(part[new] for part in looks))
                self.ids |= zip(rows[new].tolist(), grown.tolist(), strict=True)
        return self


def journey(make: Make, rng: np.random.Generator, world: Float[np.ndarray, "3"] = NOWHERE) -> Journey:
    """Return a drive that is about to begin; what it sees does not depend on where `world` puts the room."""
    turn = np.eye(3)
    turn[:2, :2] = rotation(float(world[2]))
    return Journey(make(compose(world, START), turn @ P0 @ turn.T), Room.random(rng), START.copy(), {})
