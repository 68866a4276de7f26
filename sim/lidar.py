"""The simulated range finder: exact ranges to the true faces, and noise."""

from dataclasses import dataclass

import numpy as np
from jaxtyping import Float, Int

from chainslam.slam.geometry.lines import distance_to_segments, normals, through
from chainslam.slam.geometry.quantities import Beams, Count, Deviation, Distance, Share, Sight, Size, View
from chainslam.slam.robot import LidarSpec

from .kernels import nearest, seen_from


@dataclass(frozen=True)
class LidarConfig(LidarSpec):
    """The simulated range finder (section 4 of the paper)."""

    beams: Beams = 180
    """Number of beams in a scan."""
    fov_rad: View = 2 * np.pi
    """Field of view: a full turn, or less with a beam at both ends."""
    range_max_m: Sight = 4.0
    """Maximum range; returns beyond it are rejected."""
    sigma_m: Deviation = 0.010
    """Standard deviation of the range error of a beam."""
    sigma_share: Share = 0.0
    """Standard deviation of an additional, independent range error, as a share of the range."""
    resolution_m: Distance = 0.0
    """Resolution of the ranges, which the scanner states; 0 for none."""
    cell_m: Size = 1.0
    """Cell size of the grid that speeds up ray casting; it does not change the scans."""
    cells_max: Count = 4096
    """Largest number of ray-casting cells kept in memory."""

    @property
    def is_full_turn(self) -> bool:
        """Whether the first beam follows the last one, as on a full turn."""
        return self.fov_rad > 2 * np.pi - 1e-9


def bearings(config: LidarConfig) -> Float[np.ndarray, " k"]:
    """Return the beam directions (k,) rad in the robot frame, strictly increasing and evenly spaced."""
    half = 0.5 * config.fov_rad
    return np.linspace(-half, half, config.beams, endpoint=not config.is_full_turn)


def beam_sigmas(ranges: Float[np.ndarray, " k"], config: LidarConfig) -> float | Float[np.ndarray, " k"]:
    """Return the standard deviation m of the range error of beams, given their exact ranges."""
    if config.sigma_share <= 0.0:
        return config.sigma_m
    return np.hypot(config.sigma_m, config.sigma_share * np.where(np.isfinite(ranges), ranges, 0.0))


def noisy(
    ranges: Float[np.ndarray, " k"],
    sigma_m: float | Float[np.ndarray, " k"],
    standard_normals: Float[np.ndarray, " k"],
    range_max_m: float = 4.0,
) -> Float[np.ndarray, " k"]:
    """Return ranges (k,) m with radial noise: +inf beyond `range_max_m`, NaN at 0 or less."""
    measured = ranges + sigma_m * standard_normals
    return np.where(measured > range_max_m, np.inf, np.where(measured > 0.0, measured, np.nan))


class RangeFinder:
    """Ray casting in a world of directed faces; faces seen from behind are transparent."""

    def __init__(self, faces: Float[np.ndarray, "n 2 2"], config: LidarConfig = LidarConfig()) -> None:
        """Prepare for `faces` (n, 2, 2) m in the world frame, each with its free side on the left."""
        if config.beams < 2 or not 0.0 < config.fov_rad <= 2 * np.pi + 1e-9:
            raise ValueError(
                f"expected 2 beams or more over at most a full turn, received {config.beams} over {config.fov_rad} rad"
            )
        lengths = np.hypot(*(faces[:, 1] - faces[:, 0]).T)
        self._ids = np.flatnonzero(lengths > 0.0)
        self._faces = faces[self._ids]
        self._middles, self._halves = self._faces.mean(axis=1), 0.5 * lengths[self._ids]
        alpha_r = through(self._faces)
        # One row for each face: both ends, normal and distance of its line, so that one lookup returns everything.
        self._rows = np.column_stack([self._faces.reshape(-1, 4), normals(alpha_r[:, 0]), alpha_r[:, 1]])
        self.config = config
        self.bearings_rad = bearings(config)
        self._step = float(self.bearings_rad[1] - self.bearings_rad[0])
        self._cells: dict[tuple[int, int], tuple[np.ndarray, np.ndarray]] = {}

    def cast(self, pose_world: Float[np.ndarray, "3"]) -> tuple[Float[np.ndarray, " k"], Int[np.ndarray, " k"]]:
        """Return exact ranges (k,) m, +inf beyond the maximum, and the index of the face that each beam hits, or -1."""
        x, y, heading = float(pose_world[0]), float(pose_world[1]), float(pose_world[2])
        ids, rows = self._near(x, y)
        seen, ends, inverse = seen_from(rows, x, y)
        world_bearings = self.bearings_rad + heading
        ranges, face = nearest(
            np.arctan2(ends[1::2], ends[::2]),
            inverse,
            np.cos(world_bearings),
            np.sin(world_bearings),
            heading + float(self.bearings_rad[0]),
            self._step,
            float(self.config.range_max_m),
        )
        hit = face >= 0
        face[hit] = ids[seen[face[hit]]]
        return ranges, face

    def _near(self, x: float, y: float) -> tuple[np.ndarray, np.ndarray]:
        """Return ids and rows (7, m) of the faces within range of the grid cell that holds (x, y)."""
        side = self.config.cell_m
        key = (int(x // side), int(y // side))
        cell = self._cells.get(key)
        if cell is None:
            cell = self._faces_near_cell(np.array([(key[0] + 0.5) * side, (key[1] + 0.5) * side]))
            if len(self._cells) >= self.config.cells_max:
                self._cells.clear()
            self._cells[key] = cell
        return cell

    def _faces_near_cell(self, centre: Float[np.ndarray, "2"]) -> tuple[np.ndarray, np.ndarray]:
        """Return ids and rows (7, m) of the faces that are visible from some point of the cell around `centre`."""
        radius = self.config.cell_m * np.sqrt(0.5)
        reach = self.config.range_max_m + radius + 1e-9
        faces_seen = self._rows[:, 6] - self._rows[:, 4:6] @ centre > -radius
        # Among thousands of faces in a large building, their middles alone exclude nearly all.
        within = np.hypot(*(self._middles - centre).T) <= reach + self._halves + 1e-6
        near = np.flatnonzero(faces_seen & within)
        near = near[distance_to_segments(centre[None], self._faces[near])[0] <= reach]
        return self._ids[near], np.ascontiguousarray(self._rows[near].T)
