"""Bags whose messages say no time, or say it by two clocks."""

from pathlib import Path

import numpy as np

from chainslam.experiments.replays.real_log import RealOptions, read_real_run
from tests.sim.logs.written_bag import Bag, pose_at

from .case import Case, Rng, pick
from .logs import SCANS, holds, seen_from


def clocks(rng: Rng, folder: Path) -> Case:
    """Scans and odometry by one clock, by two, or by none."""
    kind, how = pick(rng, ("ros1", "mcap", "sqlite")), int(rng.integers(3))
    low, count = -np.pi, 90
    step = 2.0 * np.pi / count
    off_s = float(pick(rng, (-1.0, 1.0)) * rng.uniform(50.0, 5e8)) if how == 1 else 0.0
    begin_s = 1.5e9
    path = folder / ("a.bag" if kind == "ros1" else "bag")
    with Bag(path, kind) as bag:
        if how == 2:
            bag.header = lambda time_s, frame, plain=bag.header: plain(0.0, frame)
        for k in range(5 * SCANS):
            time_s = begin_s + 0.1 * k
            pose = pose_at(0.02 * k)
            bag.odometry(time_s + off_s if how == 1 else time_s, pose)
            if k % 5 == 0:
                bag.scan(time_s, seen_from(pose, low + step * np.arange(count)), low, step)
    notes = {0: "expected a transform", 2: "that say 0: the time of recording"}
    read = RealOptions(odometry="wheels")
    return Case(
        lambda: read_real_run(path, read, None, {}, {}),
        holds(SCANS, 0, notes.get(how, "")),
        "expected scans and odometry on one clock" if how == 1 else "",
    )
