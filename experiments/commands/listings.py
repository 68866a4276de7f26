"""`chainslam worlds | backends | strategies`: what there is, one name first on each line.

Each listing imports only the registry that it prints.
"""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import tyro


@dataclass(frozen=True)
class Worlds:
    """List the bundled worlds and families of worlds."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from sim.worlds import listing

        return _print(listing())


@dataclass(frozen=True)
class Backends:
    """List the estimators."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from slam.backends import BACKENDS

        return _print({name: entry.description for name, entry in BACKENDS.items()})


@dataclass(frozen=True)
class Strategies:
    """List the exploration strategies."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from explore.strategies import STRATEGIES

        return _print({name: entry.description for name, entry in STRATEGIES.items()})


@dataclass(frozen=True)
class Completion:
    """Print what a shell needs to complete commands and options."""

    shell: Annotated[tyro.conf.Positional[Literal["bash", "zsh", "fish"]], tyro.conf.arg(metavar="SHELL")]
    """bash, zsh or fish; docs/commands.md says where its output belongs."""

    def run(self) -> int:
        """Print the script and return the exit status."""
        from .cli import COMMANDS
        from .parsing import readable

        classes: dict[str, Callable[..., Any]] = {name: readable(entry.load()) for name, entry in COMMANDS.items()}
        if self.shell == "fish":
            print("\n".join(_fish({name: COMMANDS[name].words for name in classes}, classes)))
            return 0
        try:
            tyro.extras.subcommand_cli_from_dict(
                classes, prog="chainslam", args=["--tyro-print-completion", self.shell]
            )
        except SystemExit as leaving:
            return int(leaving.code or 0)
        return 0


APOSTROPHE, ESCAPED = "'", r"\'"


def _fish(about: dict[str, str], classes: dict[str, Callable[..., Any]]) -> list[str]:
    """Return fish's `complete` lines, which tyro does not write."""
    from .parsing import options_of

    told = {name: words.replace(APOSTROPHE, ESCAPED) for name, words in about.items()}
    lines = [
        f"complete -c chainslam -n __fish_use_subcommand -f -a {name} -d '{words}'" for name, words in told.items()
    ]
    for name, command in classes.items():
        seen = f"complete -c chainslam -n '__fish_seen_subcommand_from {name}'"
        lines += [f"{seen} -l {option.removeprefix('--')}" for option in options_of(command)]
    return lines


def _print(descriptions: dict[str, str]) -> int:
    width = max(len(name) for name in descriptions)
    for name, description in descriptions.items():
        print(f"{name:<{width}}  {description}")
    return 0
