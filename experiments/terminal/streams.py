"""Output streams that never end a command: neither a closed pipe nor a full disk raises an error."""

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

MOST_LETTERS = 600
"""Longer messages are shortened in the middle, since a name may have thousands of characters."""


class Lasting(io.RawIOBase):
    """Writes to a file descriptor until that fails, and then discards everything."""

    def __init__(self, descriptor: int) -> None:
        self._descriptor = descriptor
        self.problem: OSError | None = None

    def writable(self) -> bool:
        """Return True: it is there to be written to."""
        return True

    def fileno(self) -> int:
        """Return the file descriptor."""
        return self._descriptor

    def isatty(self) -> bool:
        """Return whether it leads to a terminal."""
        return os.isatty(self._descriptor)

    def write(self, content) -> int:  # type: ignore[no-untyped-def]
        """Write as much as possible, and report all of it as written."""
        if self.problem is None:
            try:
                return os.write(self._descriptor, content)
            except OSError as error:
                self.problem = error
        return len(content)


@contextmanager
def lasting_streams() -> Iterator[Lasting | None]:
    """Give the process streams that accept any output, and yield the state of standard output.

    Closed streams are replaced by the null device, so that no file opened later takes their place. Streams that were
    replaced by others are left alone; then None is yielded.
    """
    for descriptor in range(3):
        try:
            os.fstat(descriptor)
        except OSError:
            os.open(os.devnull, os.O_RDWR)
    before = sys.stdout, sys.stderr
    ours = [stream is original for stream, original in zip(before, (sys.__stdout__, sys.__stderr__), strict=True)]
    for stream, is_ours in zip(before, ours, strict=True):
        if is_ours and stream is not None:
            stream.flush()
    out = Lasting(1) if ours[0] else None
    if out is not None:
        sys.stdout = _text(out, before[0])
    if ours[1]:
        sys.stderr = _text(Lasting(2), before[1])
    try:
        yield out
    finally:
        sys.stdout.flush()
        sys.stderr.flush()
        sys.stdout, sys.stderr = before


def _text(raw: Lasting, like: TextIO | None) -> io.TextIOWrapper:
    # A name may contain bytes that are not valid characters; the terminal shows them escaped.
    encoding = getattr(like, "encoding", None) or "utf-8"
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, "backslashreplace", line_buffering=True)


def one_line(message: object) -> str:
    """Return a message as one line of bounded length, with control characters escaped."""
    words = " ".join(str(message).split())
    words = "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in words)
    half = MOST_LETTERS // 2
    return words if len(words) <= MOST_LETTERS else f"{words[:half]} ... {words[-half:]}"


def is_full(error: OSError) -> bool:
    """Return whether an error means that a device is full, rather than that a file is missing."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG, errno.EPIPE)
