"""Standard output and standard error that last: whoever stops reading them, or a full disk, ends no command."""

import errno
import io
import os
import sys
from collections.abc import Iterator
from contextlib import contextmanager
from typing import TextIO

MOST_LETTERS = 600
"""A message of more than this is cut in its middle: a name may have thousands of letters."""


class Lasting(io.RawIOBase):
    """Writes to a file descriptor until that fails, and from then on to nobody."""

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
        """Write what can be written, and say of all of it that it was."""
        if self.problem is None:
            try:
                return os.write(self._descriptor, content)
            except OSError as error:
                self.problem = error
        return len(content)


@contextmanager
def lasting_streams() -> Iterator[Lasting | None]:
    """Give the process streams that take whatever is printed, and yield what became of standard output.

    Streams that were closed lead nowhere, so that no file which is opened later gets their place. Those that somebody
    else has put there are left alone; then None is yielded.
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
    # A name may hold bytes that are no letters, which a terminal still has to be told.
    encoding = getattr(like, "encoding", None) or "utf-8"
    return io.TextIOWrapper(io.BufferedWriter(raw), encoding, "backslashreplace", line_buffering=True)


def one_line(message: object) -> str:
    """Return a message as a line of bounded length, with letters in place of what would move a cursor."""
    words = " ".join(str(message).split())
    words = "".join(letter if letter.isprintable() else ascii(letter)[1:-1] for letter in words)
    half = MOST_LETTERS // 2
    return words if len(words) <= MOST_LETTERS else f"{words[:half]} ... {words[-half:]}"


def is_full(error: OSError) -> bool:
    """Whether an error says that a device takes no more, rather than that something is not there."""
    return error.errno in (errno.ENOSPC, errno.EDQUOT, errno.EIO, errno.EFBIG, errno.EPIPE)
