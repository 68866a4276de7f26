"""The command `chainslam`: one class for each subcommand, and one line in the registry."""

import gc
import os
import sys
from collections.abc import Sequence
from dataclasses import dataclass, make_dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any, Protocol, runtime_checkable

from ..artifacts.files import json_bytes
from ..terminal.answers import Output, answering
from ..terminal.interrupts import INTERRUPTED, nothing_half_built_speaks, too_late
from ..terminal.parsing import parsed
from ..terminal.streams import Lasting, is_full, lasting_streams, one_line
from ..terminal.word_order import with_files
from ..usage import UsageError, choose, missing

FAILED, BAD_USAGE = 1, 2
UTF8 = "PYTHONUTF8"
"""If this is 1, file names are UTF-8, whatever the locale."""
ABOUT = "Explore a building by wall following and map it as chains of line segments."
NEW_OBJECTS = 20_000
"""Number of new objects that triggers garbage collection: loading modules and kernels creates hundreds of thousands,
all of which stay. A start takes 5 % less time than with Python's default of 700."""


@runtime_checkable
class Command(Protocol):
    """A subcommand: its fields are its arguments."""

    def run(self) -> int:
        """Run it and return the exit status."""
        ...


@dataclass(frozen=True)
class Entry:
    """The module and description of a subcommand, so that the help does not need to import it."""

    module: str
    name: str
    words: str

    def load(self) -> Any:
        """Import the subcommand's class."""
        return getattr(import_module(f".{self.module}", __package__), self.name)

    def named(self) -> Any:
        """Return a class without arguments that only carries the description."""
        return make_dataclass(self.name, [], namespace={"__doc__": self.words}, frozen=True)


COMMANDS = {
    "demo": Entry(
        "demo",
        "Demo",
        "Explore a bundled world, replay its scans through three estimators, and open a report that compares them.",
    ),
    "explore": Entry(
        "explore",
        "Explore",
        "Explore a world until every chain of walls is closed, and write the map and its scores.",
    ),
    "replay": Entry(
        "replay",
        "Replay",
        "Map a log, or replay it through one or several back ends, all with identical scans.",
    ),
    "compare": Entry(
        "campaigns.compare",
        "Compare",
        "Run many trials of worlds x back ends x strategies, closed loop and replayed, and compare them statistically.",
    ),
    "benchmark": Entry(
        "campaigns.benchmark",
        "Benchmark",
        "Score estimators on worlds and seeds fixed by version, one row of figures each that can be cited.",
    ),
    "reproduce": Entry(
        "reproduce",
        "Reproduce",
        "Reproduce the paper's figures: a picture of each, and its numbers next to those of several back ends.",
    ),
    "measure": Entry(
        "maps.measure",
        "Measure",
        "Measure the distance between two corners of a run's map with its 95 % interval; without corners, list all.",
    ),
    "audit": Entry(
        "audit",
        "Audit",
        "Check the covariances of trajectories against the truth: consistent, overconfident, or too cautious.",
    ),
    "plan": Entry(
        "maps.plan",
        "Plan",
        "Draw a dimensioned plan of a run's or a log's map: SVG, PDF, PNG, DXF or GeoJSON, by the file's ending.",
    ),
    "check": Entry(
        "maps.check",
        "Check",
        "Compare a map with a drawing of the building: which walls are within tolerance, moved, missing or extra.",
    ),
    "view": Entry(
        "view",
        "View",
        "Open a recording in Rerun's viewer, or that of a results folder, which is made if there is none.",
    ),
    "report": Entry(
        "report",
        "Report",
        "Write the report of a campaign or a run as one self-contained HTML file, for screen, phone and paper.",
    ),
    "worlds": Entry("listings", "Worlds", "List the bundled worlds and families of worlds."),
    "backends": Entry("listings", "Backends", "List the estimators."),
    "strategies": Entry("listings", "Strategies", "List the exploration strategies."),
    "schema": Entry(
        "listings", "Schema", "Print the JSON Schema of config.json: each setting's type, range, unit and default."
    ),
    "completion": Entry("listings", "Completion", "Print the script by which a shell completes commands and options."),
}


@nothing_half_built_speaks()
def main(arguments: Sequence[str] | None = None) -> int:
    """Run one command and return its exit status: 0 done, 1 failed, 2 bad usage or input, 130 Ctrl-C.

    A closed pipe is ignored; output that cannot be written for another reason is a failure.
    """
    gc.set_threshold(NEW_OBJECTS)
    with lasting_streams() as out:
        try:
            status = _run(arguments)
        except SystemExit as leaving:
            # The parser printed its help; it reports everything else as bad usage.
            if not _is_lost(out):
                raise leaving
            status = 0
        if out is not None and _is_lost(out):
            _tell(f"expected to write to standard output, found {out.problem}: the files were written nevertheless")
            return status or FAILED
    return status


def process() -> int:
    """Run one command as the main function of a process and return its exit status, which no late signal changes."""
    status = INTERRUPTED
    if sys.getfilesystemencoding() == "ascii" and os.environ.get(UTF8) != "1":
        # Otherwise no file name with other characters could be opened.
        os.environ[UTF8] = "1"
        os.execv(sys.executable, [sys.executable, *sys.orig_argv[1:]])
    if os.environ.get("COLUMNS", "1").strip("0 ") == "":
        del os.environ["COLUMNS"]  # 0 means unknown; tables would have no room
    try:
        status = main()
        too_late()
    except KeyboardInterrupt:
        # It arrived while the command was ending, which has already printed its message.
        too_late()
    return status


def _is_lost(out: Lasting | None) -> bool:
    """Return whether output was lost although somebody reads it."""
    sys.stdout.flush()
    return out is not None and out.problem is not None and not isinstance(out.problem, BrokenPipeError)


def _run(arguments: Sequence[str] | None) -> int:
    try:
        command, output = _parse(arguments)
        with answering(output, json_bytes):
            return command.run()
    except UsageError as error:
        _tell(error)
        return error.exit_status
    except OSError as error:
        place = "" if error.filename is None else f" at {error.filename}"
        _tell(f"expected files that can be read and written, found {error.strerror or error}{place}: check that place")
        return FAILED if is_full(error) else BAD_USAGE
    except MemoryError:
        _tell("expected an input that fits into memory, found one that does not: use a smaller one")
        return FAILED
    except KeyboardInterrupt:
        return _interrupted()
    except ImportError as error:
        # An interrupt while a compiled module is loading is raised as this.
        if isinstance(error.__cause__, KeyboardInterrupt):
            return _interrupted()
        told = missing(error)
        if told is error:
            raise
        _tell(told)
        return BAD_USAGE


def _interrupted() -> int:
    _tell("interrupted; every file that was written is complete")
    return INTERRUPTED


def _tell(message: object) -> None:
    print(f"chainslam: {one_line(message)}", file=sys.stderr)


def _parse(arguments: Sequence[str] | None) -> tuple[Command, Output]:
    """Return the parsed command, and what to print; raises UsageError."""
    words = [_at_home(word) for word in (sys.argv[1:] if arguments is None else arguments)]
    if words in (["--version"], ["-V"], ["version"]):
        from importlib.metadata import version  # takes as long as the rest of the help

        print(f"chainslam {version('chainslam')}")
        raise SystemExit(0)
    if words and not words[0].startswith("-"):
        # Checked here, since `chainslam fly --help` would otherwise print the general help and end in 0.
        choose("command", words[0], COMMANDS)
    _refuse_empty(words)
    if words[:1] and words[0] in COMMANDS:
        from ..campaign.plugins import register_files, register_installed

        register_installed()
        register_files(_plugins(words))
    classes = {name: entry.load() if words[:1] == [name] else entry.named() for name, entry in COMMANDS.items()}
    made, output = parsed(words, classes, f"{ABOUT} `chainslam --version` prints the version.")
    command = with_files(made)
    asked: Command = replace(command, given=given(words)) if hasattr(command, "given") else command
    return asked, output


def _plugins(words: Sequence[str]) -> list[Path]:
    """Return the files of --plugin, which are loaded before anything else is parsed."""
    pairs = [
        (word.partition("=")[0], word.partition("=")[2] or after)
        for word, after in zip(words, [*words[1:], ""], strict=True)
    ]
    return [Path(value) for option, value in pairs if option == "--plugin" and value]


def _at_home(word: str) -> str:
    """Return a word with the home folder in place of `~`, which shells do not replace within `--out=~/x`."""
    option, equals, value = word.partition("=") if word.startswith("--") else ("", "", word)
    return f"{option}{equals}{os.path.expanduser(value)}" if value == "~" or value.startswith("~/") else word


def _refuse_empty(words: Sequence[str]) -> None:
    """Raise UsageError for an empty word: with an unset variable a path would become the current folder."""
    for before, word in zip(("", *words), words, strict=False):
        if not word or (word.startswith("--") and word.endswith("=")):
            option = word.rstrip("=") or (before if before.startswith("--") else "")
            value = f"a value for {option}" if option else "a word"
            raise UsageError(f"expected {value}, found an empty one: is a shell variable unset?")


def given(words: Sequence[str]) -> frozenset[str]:
    """Return the given options by the names of their fields; `--no-sweep` and `--sweep` are the same."""
    options = [word.partition("=")[0].removeprefix("--").replace("-", "_") for word in words if word[:2] == "--"]
    return frozenset(options) | {option.removeprefix("no_") for option in options}


if __name__ == "__main__":
    sys.exit(process())
