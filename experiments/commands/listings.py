"""`chainslam worlds | backends | strategies`: what there is, one name first on each line.

Each listing imports only the registry that it prints.
"""

import ast
import io
from collections.abc import Callable, Iterable
from contextlib import redirect_stdout, suppress
from dataclasses import dataclass
from typing import Annotated, Any, Literal

import tyro

from ..terminal.answers import found


@dataclass(frozen=True)
class Worlds:
    """List the bundled worlds and families of worlds."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from chainslam.sim.worlds import listing

        return _print(listing())


@dataclass(frozen=True)
class Backends:
    """List the estimators."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from chainslam.slam.backends import BACKENDS

        return _print({name: entry.description for name, entry in BACKENDS.items()})


@dataclass(frozen=True)
class Strategies:
    """List the exploration strategies."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from chainslam.explore.strategies import STRATEGIES

        return _print({name: entry.description for name, entry in STRATEGIES.items()})


@dataclass(frozen=True)
class Schema:
    """Print the JSON Schema of config.json: each setting's type, range, unit and default."""

    some: bool = False
    """The schema of a file for --config that holds some of the settings."""

    def run(self) -> int:
        """Print it and return the exit status."""
        from ..artifacts.files import json_bytes
        from ..views.settings_schema import config_schema

        print(json_bytes(config_schema(self.some)).decode(), end="")
        return 0


@dataclass(frozen=True)
class Completion:
    """Print the script by which a shell completes commands and options."""

    shell: Annotated[tyro.conf.Positional[Literal["bash", "zsh", "fish"]], tyro.conf.arg(metavar="SHELL")]
    """bash, zsh or fish; docs/howto/scripts.md says where its output belongs."""

    def run(self) -> int:
        """Print the script and return the exit status."""
        from ..terminal.parsing import typed
        from .cli import COMMANDS

        classes: dict[str, Callable[..., Any]] = {name: typed(entry.load()) for name, entry in COMMANDS.items()}
        script = _completed(_tyros(classes, "bash" if self.shell == "fish" else self.shell))
        if self.shell == "fish":
            script = "\n".join(_fish({name: COMMANDS[name].words for name in classes}, _spec(script)))
        print(script.rstrip("\n"))
        return 0


APOSTROPHE, ESCAPED = "'", r"\'"
SPEC = "COMPLETION_SPEC = "
"""Beginning of the line in tyro's scripts that contains all commands and options."""


def _tyros(classes: dict[str, Callable[..., Any]], shell: str) -> str:
    """Return tyro's own script for bash or zsh."""
    said = io.StringIO()
    with redirect_stdout(said), suppress(SystemExit):
        tyro.extras.subcommand_cli_from_dict(classes, prog="chainslam", args=["--tyro-print-completion", shell])
    return said.getvalue()


def _spec(script: str) -> dict[str, Any]:
    line = next(line for line in script.splitlines() if line.startswith(SPEC))
    return dict(ast.literal_eval(line.removeprefix(SPEC)))


def _completed(script: str) -> str:
    """Return tyro's script with the values that our options take, and without internal options."""
    from chainslam.explore.strategies import STRATEGIES
    from chainslam.slam.backends import BACKENDS

    spec = _spec(script)
    names: dict[str, Iterable[str]] = dict.fromkeys(("--backend", "--backends", "--driver"), BACKENDS)
    names |= dict.fromkeys(("--strategy", "--strategies"), STRATEGIES)
    for command in spec["subcommands"].values():
        command["options"] = [option for option in command["options"] if "--given" not in option["flags"]]
        for option in command["options"]:
            known = names.get(option["flags"][0], option.get("choices", ()))
            if known:
                option |= {"type": "choice", "choices": sorted(set(known) - {"None"})}
    lines = (f"{SPEC}{spec!r}" if line.startswith(SPEC) else line for line in script.splitlines())
    return "\n".join(lines)


def _fish(about: dict[str, str], spec: dict[str, Any]) -> list[str]:
    """Return fish's `complete` lines, which tyro does not write."""
    told = {name: words.replace(APOSTROPHE, ESCAPED) for name, words in about.items()}
    lines = [
        f"complete -c chainslam -n __fish_use_subcommand -f -a {name} -d '{words}'" for name, words in told.items()
    ]
    values = {"path": " -r", "value": " -x"}
    for name in about:
        seen = f"complete -c chainslam -n '__fish_seen_subcommand_from {name}'"
        for option in spec["subcommands"][name]["options"]:
            taken = f" -x -a '{' '.join(option['choices'])}'" if "choices" in option else values.get(option["type"], "")
            lines += [f"{seen} -l {flag.removeprefix('--')}{taken}" for flag in option["flags"] if flag[1] == "-"]
    return lines


def _print(descriptions: dict[str, str]) -> int:
    found(names=descriptions)
    width = max(len(name) for name in descriptions)
    for name, description in descriptions.items():
        print(f"{name:<{width}}  {description}")
    return 0
