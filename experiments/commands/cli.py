"""The command `chainslam`: one class for each subcommand, and one line in the registry."""

import io
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from dataclasses import replace
from typing import Any, Protocol, runtime_checkable

import tyro

from ..scenario import UsageError, choose
from ..terminal.interrupts import INTERRUPTED, nothing_half_built_speaks
from ..terminal.streams import Lasting, is_full, lasting_streams, one_line
from .compare import Compare
from .explore import Explore
from .listings import Backends, Strategies, Worlds
from .measure import Measure
from .replay import Replay
from .report import Report
from .reproduce import Reproduce
from .view import View

FAILED, BAD_USAGE = 1, 2


@runtime_checkable
class Command(Protocol):
    """A subcommand: its fields are its arguments."""

    def run(self) -> int:
        """Run it and return the exit status."""
        ...


COMMANDS: dict[str, Callable[..., Any]] = {
    "explore": Explore,
    "replay": Replay,
    "compare": Compare,
    "reproduce": Reproduce,
    "measure": Measure,
    "view": View,
    "report": Report,
    "worlds": Worlds,
    "backends": Backends,
    "strategies": Strategies,
}


@nothing_half_built_speaks()
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 1 failed, 2 bad usage or input, 130 Ctrl-C.

    A reader of its output that has left changes nothing; output that found no room is a failure.
    """
    with lasting_streams() as out:
        try:
            status = _run(arguments)
        except SystemExit as leaving:
            # The help; any other end of the parser is told as bad usage.
            if not _is_lost(out):
                raise leaving
            status = 0
        if out is not None and _is_lost(out):
            _tell(f"expected room on standard output, found {out.problem}: files were written all the same")
            return status or FAILED
    return status


def _is_lost(out: Lasting | None) -> bool:
    """Whether output found no place, though somebody waits for it."""
    sys.stdout.flush()
    return out is not None and out.problem is not None and not isinstance(out.problem, BrokenPipeError)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        return _parse(arguments).run()
    except UsageError as error:
        _tell(error)
        return error.exit_status
    except OSError as error:
        place = "" if error.filename is None else f" at {error.filename}"
        _tell(f"expected files that can be read and written, found {error.strerror or error}{place}: check that place")
        return FAILED if is_full(error) else BAD_USAGE
    except MemoryError:
        _tell("expected an input that fits into memory, found one that does not: take a smaller one")
        return FAILED
    except KeyboardInterrupt:
        _tell("interrupted; files that were written are whole")
        return INTERRUPTED


def _tell(message: object) -> None:
    print(f"chainslam: {one_line(message)}", file=sys.stderr)


def _parse(arguments: Sequence[str] | None) -> Command:
    """Return the command that the arguments name; raises UsageError, in one line, where they make none."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words and not words[0].startswith("-"):
        # Told here, since `chainslam fly --help` would otherwise show the help of all commands and end in 0.
        choose("command", words[0], COMMANDS)
    said = io.StringIO()
    try:
        with redirect_stderr(said):
            command: Any = tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="chainslam",
                description="Explore a building by wall following and map it as chains of line segments.",
                args=words,
            )
        asked: Command = replace(command, given=given(words)) if isinstance(command, Explore) else command
        return asked
    except SystemExit as leaving:
        if leaving.code in (0, None):
            raise
        raise UsageError(_one_line(said.getvalue())) from leaving


def given(words: Sequence[str]) -> frozenset[str]:
    """Return the options that stand in a command, by the names of their fields: `--no-sweep` and `--sweep` are one."""
    options = [word.partition("=")[0].removeprefix("--").replace("-", "_") for word in words if word[:2] == "--"]
    return frozenset(options) | {option.removeprefix("no_") for option in options}


def _one_line(boxed: str) -> str:
    """Return the first words of a boxed message of tyro."""
    lines = [line.strip(" │╭╮╰╯─\n") for line in boxed.splitlines()[1:]]
    words: list[str] = []
    for line in lines:
        if not line and words:
            break
        words.append(line)
    return f"{' '.join(' '.join(words).split()) or 'bad usage'}: see `chainslam --help`"


if __name__ == "__main__":
    sys.exit(main())
