"""Mutated inputs through every reader: none may leave a traceback, hang, or take the machine's memory.

.venv/bin/python -m tests.fuzzing --count 10000 --seed 1
"""

import contextlib
import gc
import shutil
import sys
import tempfile
import time
from collections import Counter
from dataclasses import dataclass
from pathlib import Path

import numpy as np
import tyro

from .child import run_all
from .intact import intact
from .registry import MUTATORS


@dataclass(frozen=True)
class Fuzzing:
    """Feed mutated inputs to `chainslam` and keep those that it does not bear."""

    count: int = 10_000
    """How many inputs."""
    seed: int = 1
    """Decides all of them."""
    first: int = 0
    """The number of the first, to make one again."""
    only: tuple[str, ...] = ()
    """Mutators to use; all by default."""
    keep: Path = Path("results/fuzzing")
    """Where inputs that fail are kept, each with what was said."""


BATCH = 50
"""Inputs that one process reads, one after the other."""


def main() -> int:
    """Run what the command line says and return the exit status: 0 where every input was borne."""
    wanted = tyro.cli(Fuzzing, prog="tests.fuzzing")
    names = [name for name in MUTATORS if not wanted.only or name in wanted.only]
    ends, faults, began = Counter[int | None](), 0, time.monotonic()
    slowest = largest = computed = 0.0
    intact()
    gc.freeze()
    for first in range(wanted.first, wanted.first + wanted.count, BATCH):
        with tempfile.TemporaryDirectory(prefix="fuzzing-", ignore_cleanup_errors=True) as base:
            tasks = []
            for number in range(first, min(first + BATCH, wanted.first + wanted.count)):
                name = names[number % len(names)]
                folder = Path(base) / f"{wanted.seed}-{number}-{name}"
                folder.mkdir()
                commands = MUTATORS[name](np.random.default_rng([wanted.seed, number]), folder)
                tasks += [(words, folder) for words in commands]
            for (words, folder), ended in zip(tasks, run_all(tasks), strict=True):
                ends[ended.status] += 1
                computed += ended.seconds
                slowest, largest = max(slowest, ended.seconds), max(largest, ended.mib)
                if ended.faults:
                    faults += 1
                    _keep(wanted.keep / folder.name, folder, words, ended.said)
                    print(f"{folder.name}: {', '.join(ended.faults)}: {' '.join(words)[:200]}", flush=True)
        print(f"{first + BATCH - wanted.first} inputs, {faults} not borne", file=sys.stderr)
    told = ", ".join(f"{times} ended in {status}" for status, times in sorted(ends.items(), key=str))
    print(
        f"{wanted.count} inputs, {len(names)} mutators, seed {wanted.seed}: {faults} not borne; {told}; the slowest"
        f" took {slowest:.1f} s, the largest held {largest:.0f} MiB more; {computed:.0f} s computed,"
        f" {time.monotonic() - began:.0f} s in all"
    )
    return 1 if faults else 0


def _keep(place: Path, folder: Path, words: list[str], said: str) -> None:
    shutil.rmtree(place, ignore_errors=True)
    place.parent.mkdir(parents=True, exist_ok=True)
    with contextlib.suppress(OSError):
        shutil.copytree(folder, place, symlinks=True)
    place.mkdir(exist_ok=True)
    (place / "fuzzing.txt").write_text(f"chainslam {' '.join(words)}\n\n{said}", errors="backslashreplace")


if __name__ == "__main__":
    sys.exit(main())
