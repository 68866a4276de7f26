"""The command `chainslam`: one class for each subcommand, and one line in the registry."""

import io
import os
import sys
from collections.abc import Callable, Sequence
from contextlib import redirect_stderr
from typing import Any, Protocol, runtime_checkable

import tyro

from .compare_command import Compare
from .explore_command import Explore
from .interrupts import nothing_half_built_speaks
from .listings import Backends, Strategies, Worlds
from .measure_command import Measure
from .replay_command import Replay
from .report_command import Report
from .reproduce_command import Reproduce
from .scenario import UsageError, choose
from .view_command import View

BAD_USAGE, INTERRUPTED = 2, 130


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
    """Run one command and return its exit status: 0 done, 1 failed, 2 bad usage or input, 130 Ctrl-C."""
    try:
        status = _parse(arguments).run()
        sys.stdout.flush()
        return status
    except UsageError as error:
        print(f"chainslam: {error}", file=sys.stderr)
        return BAD_USAGE
    except KeyboardInterrupt:
        print("chainslam: interrupted; files that were written are whole", file=sys.stderr)
        return INTERRUPTED
    except BrokenPipeError:
        # Whoever read the output has left; Python would complain once more while closing it.
        os.dup2(os.open(os.devnull, os.O_WRONLY), sys.stdout.fileno())
        return 0


def _parse(arguments: Sequence[str] | None) -> Command:
    """Return the command that the arguments name; raises UsageError, in one line, where they make none."""
    words = list(sys.argv[1:] if arguments is None else arguments)
    if words and not words[0].startswith("-"):
        # Told here, since `chainslam fly --help` would otherwise show the help of all commands and end in 0.
        choose("command", words[0], COMMANDS)
    said = io.StringIO()
    try:
        with redirect_stderr(said):
            command: Command = tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="chainslam",
                description="Explore a building by wall following and map it as chains of line segments.",
                args=words,
            )
        return command
    except SystemExit as leaving:
        if leaving.code in (0, None):
            raise
        raise UsageError(_one_line(said.getvalue())) from leaving


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
