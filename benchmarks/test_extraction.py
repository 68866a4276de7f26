"""Cost of extracting the segments of one scan of 180 beams."""

import itertools
from pathlib import Path

import numpy as np
import pytest
import shapely
from pytest_benchmark.fixture import BenchmarkFixture

from chainslam.sim.lidar import LidarConfig, RangeFinder, noisy
from chainslam.sim.worlds import load
from chainslam.slam.extraction.extract import extract
from chainslam.slam.robot import Scan

PLANS = Path(__file__).parents[1] / "tests" / "data" / "plans"


def scans(world_name: str, count: int, config: LidarConfig) -> list[Scan]:
    """Return noisy scans from where a robot would stand."""
    world, rng = load(world_name), np.random.default_rng(0)
    finder, free = RangeFinder(world.faces, config), world.reachable(0.25)
    x0, y0, x1, y1 = free.bounds
    taken: list[Scan] = []
    while len(taken) < count:
        pose = rng.uniform([x0, y0, -np.pi], [x1, y1, np.pi])
        if not shapely.contains_xy(free, pose[0], pose[1]):
            continue
        ranges = noisy(finder.cast(pose)[0], config.sigma_m, rng.standard_normal(config.beams), config.range_max_m)
        taken.append(Scan(finder.bearings_rad, ranges, config.sigma_m, config.range_max_m, 0.0))
    return taken


@pytest.mark.parametrize("beams", [180, 1081])
@pytest.mark.parametrize("world", ["rooms", "paper-fig5", "apartment.json"])
def test_one_extraction(benchmark: BenchmarkFixture, world: str, beams: int) -> None:
    """Typical scans in turn; the target is a median of 0.05 ms for 180 beams."""
    if world.endswith(".json"):
        world = str(PLANS / world)
    taken = itertools.cycle(scans(world, 40, LidarConfig(beams=beams)))
    benchmark(lambda: extract(next(taken)))
