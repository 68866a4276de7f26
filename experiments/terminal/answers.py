"""What a command found, as data beside what it prints: `--json` prints it in place of the words, `--quiet` nothing."""

import os
import sys
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from enum import Enum
from typing import Any


class Output(Enum):
    """What of a command goes to standard output."""

    WORDS = "words"
    JSON = "json"
    NOTHING = "nothing"


_FOUND: dict[str, Any] = {}
_QUIET: list[bool] = [False]


def found(**values: Any) -> None:
    """Keep what a command found, by name."""
    _FOUND.update(values)


def is_quiet() -> bool:
    """Return whether nothing but errors is to be shown."""
    return _QUIET[0]


@contextmanager
def answering(output: Output, encode: Callable[[dict[str, Any]], bytes]) -> Iterator[None]:
    """Show on standard output what is asked for of what a command prints and finds while the block runs."""
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
