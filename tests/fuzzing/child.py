"""Commands in a process of their own, one after the other: how each ended, what it said, what it took."""

import os
import resource
import signal
import sys
import time
import traceback
import warnings
from collections.abc import Iterator
from dataclasses import dataclass
from multiprocessing import Pipe
from multiprocessing.connection import Connection
from pathlib import Path

from chainslam.experiments.commands.cli import main

TIME_S, MEMORY_MIB, LINES = 20.0, 1024, 3
"""What one command may compute, hold beyond what every command holds, and say on standard error."""
WAIT_S = 120.0
"""A command that takes longer, on however busy a machine, is killed with its process."""


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    status: int | None
    """None where it took its process with it, or was killed."""
    said: str
    """On standard error."""
    seconds: float
    """Of computing."""
    mib: float
    """The most that it held beyond what its process had held before."""

    @property
    def faults(self) -> list[str]:
        """What is wrong with it; nothing for a command that behaves."""
        lines = self.said.splitlines()
        checks = {
            f"status {self.status}": self.status not in (0, 1, 2),
            "a traceback": "Traceback" in self.said,
            f"{len(lines)} lines on standard error": len(lines) > LINES or (self.status == 2 and len(lines) != 1),
            "a silent failure": self.status in (1, 2) and not lines,
            f"{self.seconds:.0f} s": self.seconds > TIME_S,
            f"{self.mib:.0f} MiB": self.mib > MEMORY_MIB,
        }
        return [words for words, wrong in checks.items() if wrong]


def run_all(tasks: list[tuple[list[str], Path]]) -> Iterator[Ended]:
    """Run `chainslam` with some words inside a folder, task by task, and yield how each ended.

    All in one forked process, which costs more than a command; one that dies or hangs is replaced for the tasks left.
    """
    done = 0
    while done < len(tasks):
        ours, theirs = Pipe(duplex=False)
        child = os.fork()
        if child == 0:
            _work(tasks[done:], theirs)
        theirs.close()
        try:
            while done < len(tasks):
                if not ours.poll(WAIT_S):
                    raise EOFError
                yield Ended(*ours.recv())
                done += 1
        except EOFError:
            said = _said(tasks[done][1])
            yield Ended(None, said.read_bytes().decode(errors="replace") if said.exists() else "", 0.0, 0.0)
            done += 1
        finally:
            ours.close()
            os.kill(child, signal.SIGKILL)
            os.waitpid(child, 0)


def _said(folder: Path) -> Path:
    return folder.with_name(folder.name + ".said")


def _work(tasks: list[tuple[list[str], Path]], results: Connection) -> None:
    """Perform tasks and send how each ended; never returns."""
    try:
        os.setsid()
        sys.stdout, sys.stderr = sys.__stdout__, sys.__stderr__
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        bound = (_virtual_mib() + 2 * MEMORY_MIB) << 20
        resource.setrlimit(resource.RLIMIT_AS, (bound, bound))
        for words, folder in tasks:
            results.send(_one(words, folder))
        # Killed by its parent: leaving by itself, it would run what is to run once.
        time.sleep(WAIT_S)
    finally:
        os._exit(70)


def _one(words: list[str], folder: Path) -> tuple[int, str, float, float]:
    before = resource.getrusage(resource.RUSAGE_SELF)
    os.chdir(folder)
    said = os.open(_said(folder), os.O_RDWR | os.O_CREAT | os.O_TRUNC, 0o600)
    os.dup2(said, 2)
    warnings.resetwarnings()
    warnings.simplefilter("default")
    try:
        status = main(words)
    except SystemExit as leaving:
        status = leaving.code if isinstance(leaving.code, int) else int(leaving.code is not None)
    except BaseException:
        traceback.print_exc()
        status = 1
    sys.stdout.flush()
    sys.stderr.flush()
    os.close(said)
    after = resource.getrusage(resource.RUSAGE_SELF)
    seconds = after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime
    text = _said(folder).read_bytes().decode(errors="backslashreplace")
    return status, text, seconds, (after.ru_maxrss - before.ru_maxrss) / 1024


def _virtual_mib() -> int:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() >> 20
