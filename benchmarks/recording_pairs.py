"""What a recording costs: `python -m benchmarks.recording_pairs PAIRS explore WORLD ...` or `... replay LOG ...`.

The same command with and without --rrd in turn; CPU time of whole processes, which a busy machine changes little.
"""

import os
import resource
import statistics
import subprocess
import sys
import tempfile
from pathlib import Path


def cpu_seconds(arguments: list[str]) -> float:
    """Run a command of chainslam and return the CPU time of its processes; raises CalledProcessError."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run(
        [sys.executable, "-m", "chainslam.experiments.commands.cli", *arguments], check=True, stdout=subprocess.DEVNULL,
        env=os.environ | {"OMP_NUM_THREADS": "1", "OPENBLAS_NUM_THREADS": "1"},
    )  # fmt: skip
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main() -> None:
    """Print each pair and, at the end, the median of what the recording adds, in percent."""
    pairs, command = int(sys.argv[1]), sys.argv[2:]
    added = []
    with tempfile.TemporaryDirectory() as folder:
        rrd = Path(folder) / "run.rrd"
        for _ in range(pairs):
            recorded = cpu_seconds([*command, "--out", f"{folder}/with", "--rrd", str(rrd)])
            plain = cpu_seconds([*command, "--out", f"{folder}/without"])
            added.append(100.0 * (recorded / plain - 1.0))
            print(
                f"{recorded:.2f} s and {plain:.2f} s: {added[-1]:+.1f} %, {rrd.stat().st_size / 1e6:.2f} MB", flush=True
            )
    print(f"median {statistics.median(added):+.1f} %")


if __name__ == "__main__":
    main()
