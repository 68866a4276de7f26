"""An external program that is asked line by line; whatever it does ends within the time that it is given."""

import os
import signal
from collections.abc import Iterator, Sequence
from contextlib import contextmanager, suppress
from subprocess import PIPE, Popen, TimeoutExpired
from tempfile import TemporaryFile
from threading import Event, Timer
from typing import IO

LONGEST = 1 << 16
"""Bytes of the longest answer, and of what is read from the end of its standard error."""
TOLD = 300
"""Characters of its last words that are shown."""
LAST_S = 2.0
"""A program that has closed its output may take so long to end."""


class ExternalError(RuntimeError):
    """An external program did not do its part. The message is one line."""


@contextmanager
def running(words: Sequence[str], timeout_s: float) -> Iterator["Process"]:
    """Start a program, without a shell, and end it with the block; raises ExternalError if it does not start."""
    with TemporaryFile() as errors:
        try:
            # In a session of its own, so that what it starts itself ends with it.
            popen = Popen([*words], stdin=PIPE, stdout=PIPE, stderr=errors, start_new_session=True)
        except OSError as error:
            raise ExternalError(f"{words[0]} does not start ({error.strerror})") from error
        try:
            yield Process(popen, errors, timeout_s)
        finally:
            _ended(popen)
            for stream in (popen.stdin, popen.stdout):
                with suppress(OSError):  # what was not written any more
                    assert stream is not None
                    stream.close()


class Process:
    """A running program, and the time in which it must answer."""

    def __init__(self, popen: Popen[bytes], errors: IO[bytes], timeout_s: float) -> None:
        self._popen, self._errors, self._timeout_s, self._late = popen, errors, timeout_s, Event()
        assert popen.stdin is not None
        assert popen.stdout is not None
        self._to, self._from = popen.stdin, popen.stdout

    def ask(self, line: bytes, told: bytes = b"") -> bytes:
        """Return the line that answers a line; `told` goes before it, and nothing answers that."""
        with self._in_time():
            with suppress(OSError):  # it has ended, and its last words say why
                self._to.write(told + line)
                self._to.flush()
            answer = self._from.readline(LONGEST)
        if self._late.is_set():
            raise ExternalError(f"no answer within {self._timeout_s:g} s{self._last_words()}")
        if not answer:
            raise ExternalError(f"{self._how_it_ended()}{self._last_words()}")
        return answer

    def finish(self) -> None:
        """Tell it that nothing more comes; raises ExternalError if it has said more than was asked."""
        with self._in_time():
            with suppress(OSError):
                self._to.close()
            more = self._from.read(LONGEST)
        if more.strip():
            raise ExternalError("it wrote more lines than there were scans")

    @contextmanager
    def _in_time(self) -> Iterator[None]:
        """End the program if the block takes too long, which ends the block."""

        def stop() -> None:
            self._late.set()
            _ended(self._popen)

        timer = Timer(self._timeout_s, stop)
        timer.daemon = True
        timer.start()
        try:
            yield
        finally:
            timer.cancel()

    def _how_it_ended(self) -> str:
        try:
            status = self._popen.wait(LAST_S)
        except TimeoutExpired:
            return "it closed its standard output"
        return f"it was ended by signal {-status}" if status < 0 else f"it ended with status {status}"

    def _last_words(self) -> str:
        """Return the last line of its standard error, after a colon; nothing if there is none."""
        self._errors.seek(max(self._errors.seek(0, os.SEEK_END) - LONGEST, 0))
        lines = self._errors.read().decode(errors="replace").split("\n")
        last = next((line.strip() for line in reversed(lines) if line.strip()), "")
        return f": {last[:TOLD]}" if last else ""


def _ended(popen: Popen[bytes]) -> None:
    """End a program and all that it has started."""
    with suppress(OSError):
        os.killpg(popen.pid, signal.SIGKILL)
    with suppress(TimeoutExpired):
        popen.wait(LAST_S)
