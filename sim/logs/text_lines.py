"""Lines of a text file, plain or gzip, one at a time; an error contains the line number."""

import gzip
import zlib
from collections.abc import Iterator
from pathlib import Path

from .archive import regular
from .raw_scan import LogError

LONGEST = 2**20
"""In bytes; no line of a log is as long."""
GZIP = b"\x1f\x8b"


def first_bytes(path: Path, count: int) -> bytes:
    """Return the beginning of a file; raises OSError if there is no regular file."""
    with regular(path).open("rb") as file:
        return file.read(count)


def text_lines(path: Path) -> Iterator[tuple[int, list[str]]]:
    """Yield number and words of each line that is not empty; raises OSError, and LogError for a truncated file."""
    is_packed = first_bytes(path, 2) == GZIP
    number = 0
    with gzip.open(path, "rb") if is_packed else path.open("rb") as file:
        while True:
            try:
                line = file.readline(LONGEST)
            except (EOFError, zlib.error, gzip.BadGzipFile) as error:
                raise LogError(f"after line {number}: expected more of the gzip file, found it cut short") from error
            if not line:
                return
            number += 1
            if len(line) == LONGEST:
                raise LogError(f"line {number}: expected a line of text, found one of more than {LONGEST >> 20} MiB")
            words = line.decode("latin-1").split()
            if words:
                yield number, words
