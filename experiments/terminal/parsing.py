"""From the words of a command line to one command, with types and defaults as people read them."""

import ast
import inspect
import io
import re
import types
from collections.abc import Callable, Mapping, Sequence
from contextlib import redirect_stderr
from dataclasses import Field, field, fields, is_dataclass, make_dataclass
from itertools import dropwhile, pairwise, takewhile
from pathlib import Path
from typing import Annotated, Any, Literal, Union, cast, get_args, get_origin, get_type_hints

import tyro

from ..usage import UsageError, choose, did_you_mean
from .answers import Output
from .word_order import in_order, swallowed

FOLDERS = ("out", "resume", "merge", "against")
"""Options whose path is a folder's."""
WORDS = {int: "N", float: "NUMBER", str: "NAME", Path: "FILE"}
"""What stands in the help for a value of each type."""
NAMED = {"robot": "ROBOT", "start": "X Y [HEADING]", "scale": "METRES", "threshold": "LIGHTNESS", "dask": "ADDRESS"}
"""The same, for options that want more than their type tells."""
NO_NUMBER = re.compile(
    r"Error parsing (\S+): (?:no type matching \{None\}\|)?(INT|FLOAT|invalid literal for int|could not convert string)"
    r".*?(?:: |\[)'(.*)'\]?\.?$"
)
"""How tyro says that a value is no number."""
BOX = " |│╭╮╰╯─+\n"
"""What tyro draws boxes with; where there are no letters for them, it draws lines of dashes."""
HELP = "-h", "--help"
COMMON = "--json", "--quiet", "--plugin"
MISSING = re.compile(r"Missing from [^:]*: (--\S+ \S+|\S+)|Missing value for argument '(\w+)'")
"""How tyro says that a word is not there."""


def parsed(words: Sequence[str], commands: Mapping[str, type], about: str) -> tuple[Any, Output]:
    """Return the command that some words name, and what it is to print; raises UsageError, in one line."""
    known: dict[str, Callable[..., Any]] = {name: typed(command) for name, command in commands.items()}
    asked = commands.get(words[0]) if words else None
    said = io.StringIO()
    if asked is not None:
        words = in_order(words, asked)
    try:
        with redirect_stderr(said):
            made = tyro.extras.subcommand_cli_from_dict(known, prog="chainslam", description=about, args=words)
    except SystemExit as leaving:
        if leaving.code in (0, None):
            raise
        raise UsageError(_told(_first_words(said.getvalue()), words, asked)) from leaving
    assert asked is not None
    if made.json and made.quiet:
        raise UsageError("expected --json or --quiet, found both: leave one of them out")
    output = Output.JSON if made.json else Output.NOTHING if made.quiet else Output.WORDS
    try:
        return _as(asked, made), output
    except ValueError as error:
        raise UsageError(str(error)) from error


def typed(command: type) -> type:
    """Return a command as it is typed: its readable class, with the options that every command has."""
    told = {"json": "Print the results as JSON only.", "quiet": "Print nothing but errors."}
    flag = cast(Any, tyro.conf.FlagCreatePairsOff)[bool]
    common: list[tuple[str, Any, Any]] = [
        (name, Annotated[flag, tyro.conf.arg(help=words, help_behavior_hint="")], field(default=False))
        for name, words in told.items()
    ]
    plugin = tyro.conf.arg(
        help="Python file with your own back ends, strategies or formats (docs/howto/extend.md); may be repeated.",
        help_behavior_hint="",
        metavar="FILE",
    )
    common.append(("plugin", Annotated[tyro.conf.UseAppendAction[tuple[Path, ...]], plugin], field(default=())))
    bases, own = (readable(command),), {"__doc__": command.__doc__}
    return make_dataclass(command.__name__, common, bases=bases, frozen=True, namespace=own)


def _as(kind: type, made: Any) -> Any:
    """Return a command, or a group of its options, as its own class in place of the readable one."""
    groups, values = _groups(kind), {each.name: getattr(made, each.name) for each in fields(kind)}
    return kind(**{name: _as(groups[name], value) if name in groups else value for name, value in values.items()})


def _groups(command: type) -> dict[str, type]:
    """Return the fields of a command that are options of their own, which stand beside its others."""
    hints = get_type_hints(command)
    return {each.name: hints[each.name] for each in fields(command) if is_dataclass(hints[each.name])}


def readable(command: type) -> type:
    """Return a class of the same command whose help has N for a whole number, and no word for what is not set."""
    hints, groups = get_type_hints(command, include_extras=True), _groups(command)
    about = _about(command) if hints else {}
    shown: list[tuple[str, Any, Any]] = [
        (each.name, _shown(each, hints[each.name], about.get(each.name)), each)
        for each in fields(command)
        if each.name not in groups
    ]
    for name, group in groups.items():
        kind, beside = readable(group), cast(Any, tyro.conf.OmitArgPrefixes)
        shown.append((name, beside[kind], field(default=kind())))
    # What a group checks when it is made is told by the group itself, in our form.
    own = {"__doc__": command.__doc__, "__post_init__": lambda self: None}
    return make_dataclass(command.__name__, shown, bases=(command,), frozen=True, namespace=own)


def _about(command: type) -> dict[str, str]:
    """Return what stands below each field; tyro itself would keep some of the source's line breaks."""
    body = cast(ast.ClassDef, ast.parse(inspect.getsource(command)).body[0]).body
    return {
        field.target.id: " ".join(words.value.value.split())
        for field, words in pairwise(body)
        if isinstance(field, ast.AnnAssign) and isinstance(field.target, ast.Name)
        if isinstance(words, ast.Expr) and isinstance(words.value, ast.Constant) and isinstance(words.value.value, str)
    }


def _shown(field: Field[Any], hint: Any, about: str | None) -> Any:
    """Return the annotation of a field with its words, that for its value and that for its default."""
    parts: tuple[Any, ...] = get_args(hint) if get_origin(hint) is Annotated else (hint,)
    if tyro.conf.Suppress in parts:
        return hint
    said = next((part.metavar for part in parts if getattr(part, "metavar", None)), None)
    default: str | None = None
    if field.default is None or field.default == ():
        default = ""
    elif isinstance(field.default, bool):
        default = f"(default: {'on' if field.default else 'off'})"
    word = said or _word(field.name, parts[0])
    return Annotated[hint, tyro.conf.arg(metavar=word, help=about, help_behavior_hint=default)]


def _word(name: str, kind: Any) -> str | None:
    """Return what stands in the help for a value; None where tyro's own word is the one to read."""
    if name in NAMED:
        return NAMED[name]
    if get_origin(kind) in (Union, types.UnionType):
        kind = next(part for part in get_args(kind) if part is not types.NoneType)
    if get_origin(kind) is tuple:
        inner = get_args(kind)
        one = _word(name, inner[0])
        return one and (f"{one} ..." if inner[-1] is Ellipsis else " ".join([one] * len(inner)))
    if get_origin(kind) is Literal:
        return f"{{{','.join(map(str, get_args(kind)))}}}"
    return "DIR" if kind is Path and name in FOLDERS else WORDS.get(kind)


def options_of(command: Any) -> list[str]:
    """Return the options of a command as they are typed."""
    hints = get_type_hints(command, include_extras=True)
    named: list[str] = []
    for each in fields(command):
        parts = get_args(hints[each.name])
        if parts and is_dataclass(parts[0]):
            named += options_of(parts[0])
            continue
        if tyro.conf.Suppress in parts or tyro.conf.Positional in parts:
            continue
        option = each.name.replace("_", "-")
        named += [f"--{option}", f"--no-{option}"] if isinstance(each.default, bool) else [f"--{option}"]
    return named


def _told(message: str, words: Sequence[str], command: type | None) -> str:
    """Return tyro's message in our own form: what was expected, what was found, what is near to it."""
    if command is None:
        return (
            "expected a command, found none: see `chainslam --help`"
            if not words
            else f"{message}: see `chainslam --help`"
        )
    name, see = words[0], f"see `chainslam {words[0]} --help`"
    if message.startswith("Unrecognized options: "):
        rest = message.removeprefix("Unrecognized options: ").split(", ")
        options = [word.partition("=")[0] for word in rest if word.startswith("-")]
        if not options:
            return f"expected no more words for {name}, found {rest[0]!r}: {see}"
        near = did_you_mean(options[0], [*options_of(command), *COMMON, *HELP])
        return f"expected an option of {name}, found {options[0]}{near}: {see}"
    if missing := MISSING.match(message):
        took = swallowed(words, command)
        what = missing[1] or missing[2].upper()
        return f"expected {what} for {name}, found none{took}: {'put it first' if took else see}"
    choice = re.match(r"invalid choice '(.*)' for argument '(.*?)'\. Expected one of \((.*)\)\.?$", message)
    if choice:
        known = [word for word in re.findall(r"'([^']*)'", choice[3]) if word != "None"]
        try:
            choose(f"value of {choice[2]}", choice[1], sorted(known))
        except UsageError as error:
            return str(error)
    if number := NO_NUMBER.match(message):
        kind = "a whole number" if "int" in number[2].lower() else "a number"
        return f"expected {kind} for {number[1]}, found {number[3]!r}: {see}"
    return f"{message}: {see}"


def _first_words(boxed: str) -> str:
    """Return the first words of a boxed message of tyro."""
    title, *lines = [line.strip(BOX) if line.strip(f"{BOX}-") else "" for line in boxed.splitlines()]
    words = list(takewhile(bool, dropwhile(lambda line: not line, lines)))
    return " ".join(" ".join(words).split()) or title or "bad usage"
