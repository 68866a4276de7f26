"""A ring of corridors of any length and noisy observations on the way round it, without scans or a mapper."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from jaxtyping import Float

from chainslam.sim.chance import Chance, Channel, world_key
from chainslam.slam.geometry.lines import directions, normals, through
from chainslam.slam.geometry.poses import compose, inverse, to_world

from .observations import DriveObservations, ScanObservations
from .oracles import as_stated

HALF_WIDTH_M = 1.2
NICHE_M = 0.6
"""Depth of the niches, whose sides localise the robot along the corridor."""
PIECE_M = (2.0, 5.0)
"""Shortest and longest piece of wall between two niches."""
RANGE_M = 4.0
BEAM_RAD = float(np.deg2rad(2.0))
BEAM_SIGMA_M = 0.01
LEAST_BEAMS = 5
FIRM_RAD = float(np.deg2rad(6.0))


@dataclass(frozen=True)
class Loop:
    """A drive round the ring and beyond its beginning."""

    length_m: float = 200.0
    """Length of the ring along its middle."""
    heading_deg: float = 0.6
    """Standard deviation of the heading error of the odometry after one metre; it grows with the square root."""
    gap_m: float = 0.0
    """Length of the last stretch before the ring closes, on which nothing is observed."""
    after_m: float = 20.0
    """Length of the drive after the ring is closed."""
    step_m: float = 0.25

    @property
    def way_m(self) -> Float[np.ndarray, " s"]:
        """Position of each scan along the ring's middle."""
        return self.step_m * np.arange(int((self.length_m + self.after_m) / self.step_m) + 1)

    @property
    def closing_step(self) -> int:
        """The first scan at which the ring is closed."""
        return int(np.argmax(self.way_m >= self.length_m))


def drive(loop: Loop, seed: int) -> DriveObservations:
    """Return a drive round a ring with randomly placed niches and noise as stated."""
    walls = ring(loop.length_m, np.random.default_rng(seed))
    way = loop.way_m
    poses = on_ring(way, loop.length_m)
    chance = Chance(seed, world_key(walls, poses[0]))
    motions, covs = _wheels(poses, loop, chance)
    again, first = [], []
    lines, known = through(walls), np.zeros(len(walls), dtype=bool)
    for step, (at, pose) in enumerate(zip(way, poses, strict=True)):
        draws = chance.standard_normals(Channel.LASER, step, 2 * len(walls))
        looks = look(walls, lines, pose, draws.reshape(-1, 2))
        if loop.length_m - loop.gap_m < at < loop.length_m:
            looks = looks.take(np.zeros(0, dtype=np.int64))
        old = known[looks.walls]
        again.append(looks.take(old))
        first.append(looks.take(~old))
        known[looks.walls] = True
    return DriveObservations(motions, covs, tuple(again), tuple(first), poses, dict(enumerate(lines)), chance)


def on_ring(way_m: Float[np.ndarray, " s"], length_m: float) -> Float[np.ndarray, "s 3"]:
    """Return poses on a square of this circumference, counter-clockwise, its corners rounded by 1 m."""
    radius = 1.0
    side = (length_m - 2.0 * np.pi * radius) / 4.0
    quarter = side + 0.5 * np.pi * radius
    turns, rest = np.divmod(way_m, quarter)
    bend = np.maximum(rest - side, 0.0) / radius
    x = np.minimum(rest, side) + radius * np.sin(bend)
    y = radius * (1.0 - np.cos(bend))
    poses = np.empty((len(way_m), 3))
    corner = np.zeros(3)
    for turn in range(int(turns.max()) + 1):
        here = turns == turn
        poses[here, :2] = to_world(np.stack([x[here], y[here]], axis=-1), corner)
        poses[here, 2] = corner[2] + bend[here]
        corner = compose(corner, np.array([side + radius, radius, 0.5 * np.pi]))
    poses[:, 2] = (poses[:, 2] + np.pi) % (2 * np.pi) - np.pi
    return poses


def ring(length_m: float, rng: np.random.Generator) -> Float[np.ndarray, "n 2 2"]:
    """Return the faces of both walls of each side of the ring; every second piece is set back by a niche."""
    quarter = (length_m - 2.0 * np.pi) / 4.0 + 0.5 * np.pi
    starts = on_ring(quarter * np.arange(4.0), length_m)
    faces = []
    for begin in starts:
        for left in (True, False):
            cuts = np.cumsum(np.concatenate([[0.0], rng.uniform(*PIECE_M, int(quarter / PIECE_M[0]))]))
            cuts = np.append(cuts[cuts < quarter - 1.0], quarter)
            # The outer wall continues around the corner, the inner one ends before it.
            cuts = np.clip(cuts, *((HALF_WIDTH_M, quarter - HALF_WIDTH_M) if left else (-1.0, quarter + 1.0)))
            back = HALF_WIDTH_M + NICHE_M * (np.arange(len(cuts) - 1) % 2)
            points = np.stack([np.repeat(cuts, 2)[1:-1], np.repeat(back, 2)], axis=-1)
            points = points * [1.0, 1.0 if left else -1.0]
            pieces = np.stack([points[:-1], points[1:]], axis=1)
            pieces = pieces[np.hypot(*(pieces[:, 1] - pieces[:, 0]).T) > 0.1]
            # The free side is on the left: a wall on the robot's left points against its direction of travel.
            faces.append(to_world(pieces[:, ::-1] if left else pieces, begin))
    return np.concatenate(faces)


def _wheels(
    poses: Float[np.ndarray, "s 3"], loop: Loop, chance: Chance
) -> tuple[Float[np.ndarray, "s 3"], Float[np.ndarray, "s 3 3"]]:
    """Return the odometry and its covariance: 14 mm along and 6 mm across per square root of a metre."""
    cov = loop.step_m * np.diag([0.014, 0.006, np.deg2rad(loop.heading_deg)]) ** 2
    true = [compose(inverse(a), b) for a, b in pairwise(poses)]
    draws = [chance.standard_normals(Channel.WHEELS, step, 3) for step in range(len(true))]
    noise = np.array(draws) * np.sqrt(np.diag(cov))
    return np.concatenate([np.zeros((1, 3)), np.array(true) + noise]), np.tile(cov, (len(poses), 1, 1))


def look(
    walls: Float[np.ndarray, "n 2 2"],
    lines: Float[np.ndarray, "n 2"],
    pose: Float[np.ndarray, "3"],
    standard_normals: Float[np.ndarray, "n 2"],
    share: float = 1.0,
) -> ScanObservations:
    """Return the visible walls within range, each with the noise of its beams, whose sigma is scaled by `share`."""
    n, t = normals(lines[:, 0]), directions(lines[:, 0])
    r = lines[:, 1] - n @ pose[:2]
    along = np.sort(np.sum((walls - pose[:2]) * t[:, None], axis=-1), axis=1)
    reach = np.sqrt(np.maximum(RANGE_M**2 - r**2, 0.0))[:, None]
    along = np.clip(along, -reach, reach)
    safe = np.maximum(r, 0.05)
    beams = np.diff(np.arctan(along / safe[:, None]), axis=1)[:, 0] / BEAM_RAD
    length = along[:, 1] - along[:, 0]
    seen = (r > 0.05) & (r < RANGE_M) & (beams >= LEAST_BEAMS)
    beams, t0 = np.maximum(beams, 1.0), along.mean(axis=1)
    sigma_m = share * BEAM_SIGMA_M
    a = sigma_m**2 * 12.0 / (beams * np.maximum(length, 1e-3) ** 2)
    cov = np.stack([np.stack([a, t0 * a], -1), np.stack([t0 * a, sigma_m**2 / beams + t0**2 * a], -1)], -2)
    rows = np.flatnonzero(seen & (a < (share * FIRM_RAD) ** 2))
    true = np.stack([lines[rows, 0] - pose[2], r[rows]], axis=-1)
    bearings_rad = true[:, 0] + np.arctan2(t0[rows], r[rows])
    drawn, stated = as_stated(true, bearings_rad, cov[rows], standard_normals[rows])
    centres = r[rows, None] * normals(true[:, 0]) + t0[rows, None] * directions(true[:, 0])
    return ScanObservations(rows, drawn, stated, centres)
