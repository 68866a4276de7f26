"""Compile all loops before the first run; `make setup` does so.

`python -m chainslam.experiments.commands.compile_kernels` drives three runs, replays one with scan matching, and
discards them.
"""

import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from chainslam.slam.association.place_search import Window, place_on

from .cli import main

RUNS = ("paper-fig9", "rooms --seed 2 --backend invariant-ekf", "hall")
"""To their ends: walls meet, close and are merged; in the second some turn out to be none, in hall one is split."""


def compile_kernels() -> int:
    """Call the kernels of a step, of the graph and of scan matching once and return the exit status."""
    # So short a run never loses the robot.
    place_on(np.zeros((1, 2)), np.zeros((1, 2)), Window(np.zeros(3), 0.1, 0.1))
    with TemporaryDirectory() as folder, redirect_stdout(StringIO()):
        driven, replayed = (Path(folder) / name for name in ("driven", "replayed"))
        status = max(main(["explore", *run.split(), "--out", f"{driven}{i}"]) for i, run in enumerate(RUNS))
        log = f"{driven}0/log.npz"
        return status or main(
            ["replay", log, "--backend", "graph", "invariant-ekf", "--odometry", "scans", "--out", str(replayed)]
        )


if __name__ == "__main__":
    sys.exit(compile_kernels())
