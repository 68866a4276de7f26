"""Cost of one exact scan of 180 beams, beside plain numpy over all faces, at 50, 500 and 5,000 faces."""

import numpy as np
import pytest
from pytest_benchmark.fixture import BenchmarkFixture

from chainslam.sim.lidar import LidarConfig, RangeFinder, bearings


def rooms(faces: int) -> np.ndarray:
    """Return about `faces` faces: rooms of 3 m with a doorway in two walls and a pillar, in a square block."""
    outline = [(0, 0), (1, 0), (1, -0.1), (2, -0.1), (2, 0), (3, 0), (3, 3), (2, 3), (2, 3.1), (1, 3.1), (1, 3), (0, 3)]
    pillar = [(0.6, 1.4), (0.6, 1.7), (0.9, 1.7), (0.9, 1.4)]
    loops = [np.array(loop, dtype=float) for loop in (outline, pillar)]
    one = np.concatenate([np.stack([loop, np.roll(loop, -1, axis=0)], axis=1) for loop in loops])
    count = int(np.ceil(faces / len(one)))
    side = int(np.ceil(np.sqrt(count)))
    places = np.array([(3.4 * (i % side), 3.4 * (i // side)) for i in range(count)])
    return (one[None] + places[:, None, None]).reshape(-1, 2, 2)[:faces]


def walk(steps: int, size: float) -> np.ndarray:
    """Return poses 0.15 m apart through the block of rooms."""
    s = 0.15 * np.arange(steps)
    return np.column_stack([1.5 + s % max(size - 3.0, 1.0), np.full(steps, 1.45), 0.3 * s])


def all_pairs(faces: np.ndarray, directions: np.ndarray, pose: np.ndarray) -> np.ndarray:
    """Return ranges from every beam against every face in plain numpy."""
    d = np.stack([np.cos(directions + pose[2]), np.sin(directions + pose[2])], axis=-1)[:, None]
    start, along = faces[:, 0] - pose[:2], faces[:, 1] - faces[:, 0]
    det = d[..., 0] * along[:, 1] - d[..., 1] * along[:, 0]
    with np.errstate(divide="ignore", invalid="ignore"):
        distance = (start[:, 0] * along[:, 1] - start[:, 1] * along[:, 0]) / det
        share = (start[:, 0] * d[..., 1] - start[:, 1] * d[..., 0]) / det
        return np.where((distance > 0) & (share >= 0) & (share <= 1), distance, np.inf).min(axis=1)


@pytest.mark.parametrize("faces", [50, 500, 5000])
@pytest.mark.parametrize("how", ["ours", "numpy over all faces"])
def test_one_scan(benchmark: BenchmarkFixture, faces: int, how: str) -> None:
    """A walk of 0.15 m steps, so that the cost of entering new cells is in the mean; the target is 0.15 ms."""
    world, config = rooms(faces), LidarConfig()
    poses = iter(np.tile(walk(200, 3.4 * np.sqrt(faces / 16)), (5000, 1)))
    finder, directions = RangeFinder(world, config), bearings(config)
    if how == "ours":
        benchmark(lambda: finder.cast(next(poses)))
    else:
        benchmark.pedantic(lambda: all_pairs(world, directions, next(poses)), rounds=10)
