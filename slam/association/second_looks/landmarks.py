"""Which segments of all scans are of one line, at the poses as they are believed now."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Bool, Float, Int

from ...extraction.segments import Segments
from ...geometry.lines import directions, normals
from ...geometry.poses import turned, wrap
from .config import SecondLooksConfig

ROOM = 256
"""Rows by which the table of lines grows."""


@dataclass(frozen=True)
class Sightings:
    """The firm segments of all scans, n of them, robot frame."""

    scan: Int[np.ndarray, " n"]
    """The scan of each."""
    alpha: Float[np.ndarray, " n"]
    ends: Float[np.ndarray, "n 2 2"]
    sigma_rad: Float[np.ndarray, " n"]
    sigma_m: Float[np.ndarray, " n"]
    """Of the offset of its middle."""

    def __len__(self) -> int:
        return len(self.scan)

    def take(self, rows: Bool[np.ndarray, " n"]) -> "Sightings":
        """Return the chosen ones."""
        return Sightings(*(getattr(self, name)[rows] for name in self.__dataclass_fields__))

    @property
    def middles(self) -> Float[np.ndarray, "n 2"]:
        """The middle of each."""
        return np.asarray(self.ends.mean(axis=1))


NO_SIGHTINGS = Sightings(np.zeros(0, dtype=np.int64), np.zeros(0), np.zeros((0, 2, 2)), np.zeros(0), np.zeros(0))


def firm(scan: int, segments: Segments, config: SecondLooksConfig) -> Sightings:
    """Return the segments of one scan that are long enough and known well enough."""
    length = np.hypot(*(segments.ends[:, 1] - segments.ends[:, 0]).T)
    aa = segments.cov[:, 0, 0]
    rows = np.flatnonzero(
        (length > config.least_m) & (segments.beam_counts >= config.least_beams) & (aa < config.firm_rad**2)
    )
    off = segments.cov[rows, 1, 1] - segments.cov[rows, 0, 1] ** 2 / aa[rows]
    return Sightings(
        np.full(len(rows), scan), segments.lines[rows, 0], segments.ends[rows], np.sqrt(aa[rows]),
        np.sqrt(np.maximum(off, 0.0)),
    )  # fmt: skip


def joined(parts: list[Sightings]) -> Sightings:
    """Return the sightings of all scans as one."""
    columns = (np.concatenate([getattr(part, name) for part in parts]) for name in Sightings.__dataclass_fields__)
    return Sightings(*columns)


class _Lines:
    """A table of lines that grows, each with the moments of the ends that were laid on it."""

    def __init__(self) -> None:
        self.count = 0
        self.alpha, self.r = np.zeros(0), np.zeros(0)
        self.span = np.zeros((0, 2))
        self._weight, self._sum, self._square = np.zeros(0), np.zeros((0, 2)), np.zeros((0, 2, 2))

    def begin(self, alpha: float, ends: Float[np.ndarray, "2 2"]) -> int:
        """Add a line and return its row."""
        if self.count == len(self.alpha):
            for name in ("alpha", "r", "span", "_weight", "_sum", "_square"):
                old = getattr(self, name)
                setattr(self, name, np.concatenate([old, np.zeros((ROOM, *old.shape[1:]))]))
        row, self.count = self.count, self.count + 1
        self.alpha[row] = alpha
        self.span[row] = np.sort(ends @ directions(self.alpha[row]))
        self.lay(row, ends)
        return row

    def lay(self, row: int, ends: Float[np.ndarray, "2 2"]) -> None:
        """Lay a segment on a line, which then runs through all ends on it as well as it can."""
        length = float(np.hypot(*(ends[1] - ends[0])))
        self._weight[row] += 2.0 * length
        self._sum[row] += length * ends.sum(axis=0)
        self._square[row] += length * ends.T @ ends
        middle = self._sum[row] / self._weight[row]
        spread = self._square[row] / self._weight[row] - np.outer(middle, middle)
        turn = 0.5 * np.arctan2(2.0 * spread[0, 1], spread[0, 0] - spread[1, 1])
        # Along the line; its normal keeps the side from which it was seen.
        alpha = turn - 0.5 * np.pi
        self.alpha[row] = wrap(alpha if np.cos(alpha - self.alpha[row]) > 0 else alpha + np.pi)
        self.r[row] = normals(self.alpha[row]) @ middle
        along = ends @ directions(self.alpha[row])
        self.span[row] = min(self.span[row, 0], along.min()), max(self.span[row, 1], along.max())


def associated(
    sightings: Sightings, poses_world: Float[np.ndarray, "s 3"], gate_m: float, config: SecondLooksConfig
) -> Int[np.ndarray, " n"]:
    """Return the line of each sighting, numbered from 0; -1 for those of lines that were seen too rarely."""
    poses = poses_world[sightings.scan]
    ends = turned(sightings.ends, poses[:, 2]) + poses[:, None, :2]
    alpha = wrap(sightings.alpha + poses[:, 2])
    lines, owner = _Lines(), np.full(len(sightings), -1, dtype=np.int64)
    least = np.cos(config.turn_rad)
    for k in range(len(sightings)):
        owner[k] = _nearest(lines, alpha[k], ends[k], gate_m, least, config.overlap_m)
        if owner[k] < 0:
            owner[k] = lines.begin(alpha[k], ends[k])
        else:
            lines.lay(int(owner[k]), ends[k])
    often = np.bincount(owner, minlength=lines.count) >= config.least_sightings
    number = np.where(often, np.cumsum(often) - 1, -1)
    return np.asarray(number[owner]) if len(owner) else owner


def _nearest(
    lines: _Lines, alpha: float, ends: Float[np.ndarray, "2 2"], gate_m: float, least_cosine: float, overlap_m: float
) -> int:
    """Return the row of the line that lies nearest along a segment, -1 where none does."""
    n = lines.count
    near = np.flatnonzero(np.cos(lines.alpha[:n] - alpha) > least_cosine)
    if not len(near):
        return -1
    across = np.abs(normals(lines.alpha[near]) @ ends.T - lines.r[near, None]).max(axis=1)
    along = directions(lines.alpha[near]) @ ends.T
    low, high = np.minimum(along[:, 0], along[:, 1]), np.maximum(along[:, 0], along[:, 1])
    overlap = np.minimum(high, lines.span[near, 1]) - np.maximum(low, lines.span[near, 0])
    fits = (across < gate_m) & (overlap >= overlap_m)
    return int(near[np.argmin(np.where(fits, across, np.inf))]) if fits.any() else -1
