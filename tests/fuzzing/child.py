"""One command in a process of its own: how it ended, what it said, how long it took and how much it held."""

import os
import resource
import signal
import sys
import time
import traceback
import warnings
from dataclasses import dataclass
from pathlib import Path

from experiments.cli import main

TIME_S, MEMORY_MIB, LINES = 20.0, 1024, 3
"""What one command may compute, hold beyond what every command holds, and say on standard error."""
WAIT_S = 120.0
"""A command that takes longer, on however busy a machine, is killed."""


@dataclass(frozen=True)
class Ended:
    """How a command ended."""

    status: int | None
    """None where it was killed."""
    said: str
    """On standard error."""
    seconds: float
    """Of computing."""
    mib: float
    """The most that it held beyond this process."""

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


def run(words: list[str], folder: Path) -> Ended:
    """Run `chainslam` with some words in a forked process, inside `folder`; killed after `WAIT_S`."""
    said, began = folder.with_name(folder.name + ".said"), time.monotonic()
    sys.stdout.flush()
    sys.stderr.flush()
    child = os.fork()
    if child == 0:
        _command(words, folder, said)
    status, used = _waited(child, began + WAIT_S)
    held = used.ru_maxrss / 1024 - _resident_mib()
    code = os.waitstatus_to_exitcode(status)
    text = said.read_bytes().decode(errors="backslashreplace")
    said.unlink()
    return Ended(code if code >= 0 else None, text, used.ru_utime + used.ru_stime, held)


def _command(words: list[str], folder: Path, said: Path) -> None:
    """Become the command: never returns."""
    status = 70
    try:
        os.setsid()
        os.chdir(folder)
        os.dup2(os.open(os.devnull, os.O_WRONLY), 1)
        os.dup2(os.open(said, os.O_WRONLY | os.O_CREAT | os.O_TRUNC, 0o600), 2)
        bound = (int(_virtual_mib()) + 2 * MEMORY_MIB) << 20
        resource.setrlimit(resource.RLIMIT_AS, (bound, bound))
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
    finally:
        os._exit(status)


def _waited(child: int, until: float) -> tuple[int, resource.struct_rusage]:
    pause = 0.001
    while True:
        pid, status, used = os.wait4(child, os.WNOHANG)
        if pid:
            return status, used
        if time.monotonic() > until:
            os.killpg(child, signal.SIGKILL)
            _, status, used = os.wait4(child, 0)
            return status, used
        time.sleep(pause)
        pause = min(2 * pause, 0.02)


def _resident_mib() -> float:
    return int(Path("/proc/self/statm").read_text().split()[1]) * resource.getpagesize() / 2**20


def _virtual_mib() -> float:
    return int(Path("/proc/self/statm").read_text().split()[0]) * resource.getpagesize() / 2**20
