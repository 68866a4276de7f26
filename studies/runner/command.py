"""A study as a command: its options on the command line, and what is wrong with them in one line."""

import sys
from typing import Protocol

import tyro

from chainslam.experiments.usage import UsageError


class Study(Protocol):
    """What `run_study` asks of a study: a dataclass of options that knows how to run itself."""

    def run(self) -> int | None:
        """Run what is to be run, print what came of it, and return the exit status where it is not 0."""
        ...


def run_study(kind: type[Study]) -> None:
    """Run the study that the command line describes and end with its status: 2, in one line, for what is no input."""
    spec = sys.modules["__main__"].__spec__
    name = kind.__name__ if spec is None else spec.name
    try:
        status = tyro.cli(kind, prog=name).run()
    except UsageError as error:
        print(f"{name}: {error}", file=sys.stderr)
        status = 2
    sys.exit(status)
