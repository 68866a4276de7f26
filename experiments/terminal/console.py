"""Output to the terminal, safe for any characters in names."""

import shlex
import sys
from pathlib import Path

from rich.console import Console

from .streams import one_line


def plain_console(*, stderr: bool = False, width: int | None = None) -> Console:
    """Return a console without markup and emoji: names are the user's, and `random:1234:` is an emoji."""
    return Console(stderr=stderr, width=width, markup=False, emoji=False)


def say(words: str, *, stderr: bool = False) -> None:
    """Print one line, with control characters replaced, since file names are the user's too."""
    print(one_line(words), file=sys.stderr if stderr else sys.stdout)


def written(folder: Path) -> str:
    """Return where results are, and the command that makes one page of them."""
    return f"results in {folder}; as one page: chainslam report {shlex.quote(str(folder))}"
