"""Results of a command as data, next to its printed output: `--json` prints them instead, `--quiet` prints nothing."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from enum import Enum
from typing import Any


class Output(Enum):
    """What a command writes to standard output."""

    WORDS = "words"
    JSON = "json"
    NOTHING = "nothing"


_FOUND: dict[str, Any] = {}
_QUIET: list[bool] = [False]


def found(**values: Any) -> None:
    """Record results of a command, by name."""
    _FOUND.update(values)


def is_quiet() -> bool:
    """Return whether only errors are to be shown."""
    return _QUIET[0]


@contextmanager
def answering(output: Output, encode: Callable[[dict[str, Any]], bytes]) -> Iterator[None]:
    """Select what reaches standard output while the block runs: printed text, the results as JSON, or nothing."""
    _FOUND.clear()
    if output is Output.WORDS:
        yield
        return
    _QUIET[0] = output is Output.NOTHING
    try:
        with open(os.devnull, "w", encoding="utf-8") as nowhere, redirect_stdout(nowhere):
            yield
    finally:
        _QUIET[0] = False
    if output is Output.JSON:
        sys.stdout.write(encode(_FOUND).decode())
