"""Compile the loops that steps run ahead of the first run: `make setup` does so.

`python -m experiments.library.compile_kernels` drives a short run and replays it with scan matching, and keeps neither.
"""

import sys
from contextlib import redirect_stdout
from io import StringIO
from pathlib import Path
from tempfile import TemporaryDirectory

import numpy as np

from explore.floor.carrying_kernels import carried

from ..commands.cli import main

STEPS = "200"
"""Of `paper-fig9`: its walls meet, close and are merged by then."""


def compile_kernels() -> int:
    """Call the kernels of a step, of the graph and of scan matching once and return the exit status."""
    # No grid is drawn anew in so short a run.
    carried(np.zeros((1, 3)), np.ones(1), np.zeros(1), np.zeros((1, 2, 2)), np.zeros((1, 2)), 0.01)
    with TemporaryDirectory() as folder, redirect_stdout(StringIO()):
        run, replayed = Path(folder) / "run", Path(folder) / "replayed"
        status = main(["explore", "paper-fig9", "--max-steps", STEPS, "--out", str(run)])
        log = str(run / "log.npz")
        return status or main(
            ["replay", log, "--backend", "graph", "invariant-ekf", "--odometry", "scans", "--out", str(replayed)]
        )


if __name__ == "__main__":
    sys.exit(compile_kernels())
