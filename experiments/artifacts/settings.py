"""Settings of a trial by name: from a file (`--config`) and one by one (`--set KEY=VALUE`), over the defaults.

Keys are those of `config.json`, with a dot between an object and what it holds: `mission.mapper.matching.gate`.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping, Sequence
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from pathlib import Path
from typing import Any, get_type_hints

from sim.worlds import DrawingOptions, WorldError
from slam.robot import STATED, RobotError

from ..scenario import TrialConfig
from ..usage import UsageError
from .files import json_bytes
from .formats import CONFIG, is_past, stated_then, today, told_of
from .reading import UnfitError, check_format, fit, plain_json, read_plain, told

REMEDY = "name a run's config.json, or a JSON object with some of its keys"
NAVIGATION = "mission.explorer.following.navigation"
FOLLOWING = "mission.explorer.following.method"
DRAWING = tuple(each.name for each in fields(DrawingOptions))
"""Options that say how a world's file is read."""
SEE = "config.json of any run names all"
Record = dict[str, Any]


def read_settings(path: Path) -> Record:
    """Return the settings in a file, as a nested record: a run's whole `config.json`, or an object of some keys of one.

    Raises UsageError, in one line, for any other file, and for a key that no trial has.
    """
    with told(path, REMEDY):
        said = read_plain(path)
        if "trial" not in said:
            for key, value in leaves(said):
                _place(key, value)
            return said
        check_format(said, CONFIG, older=False)
        fit(TrialConfig, said["trial"], "trial")
        trial: Record = said["trial"]
    return trial


def converted(said: Mapping[str, Any]) -> tuple[TrialConfig, tuple[str, ...]]:
    """Return what still holds of a trial in an older format, and the keys of what means nothing now.

    The defaults take the places of settings that are not there. Raises UnfitError where no world is named.
    """
    record, unknown, robot = defaults(), [], stated_then(said)
    for key, value in leaves(said):
        found = today(key, value, robot)
        if found is None:
            continue
        try:
            _place(*found)
        except UnfitError:
            unknown.append(key)
        else:
            record = over(record, nested([found]))
    if not record["world"]:
        raise UnfitError("no trial.world")
    return fit(TrialConfig, record), tuple(unknown)


def parse_setting(text: str) -> Record:
    """Return one `KEY=VALUE` as a nested record; raises UsageError for a key that no trial has and for other text.

    A value is JSON; what is no JSON is text.
    """
    key, equals, words = text.partition("=")
    if not equals or not key:
        raise UsageError(f"expected --set KEY=VALUE, found {text[:60]!r}: write it so")
    try:
        value = _value(words)
        _place(key, value)
    except UnfitError as error:
        raise UsageError(f"expected a setting, found {error}: {SEE}") from error
    for part in reversed(key.split(".")):
        value = {part: value}
    return dict(value)


def asked(file: Path | None, sets: Sequence[str], settled: Collection[str]) -> Record:
    """Return what --config and --set ask for, --set on top, of a command that settles some keys itself.

    Those are left aside in a file. Raises UsageError, also where --set names one of them.
    """
    named = over({}, *map(parse_setting, sets))
    for key in named.keys() & set(settled):
        raise UsageError(f"expected --set of what this command leaves open, found {key!r}: it is settled otherwise")
    base = {} if file is None else read_settings(file)
    return over({key: value for key, value in base.items() if key not in settled}, named)


def differing(trial: TrialConfig) -> list[tuple[str, Any]]:
    """Return the dotted keys and values in which the settings of a trial are not the defaults."""
    before = dict(leaves(defaults()))
    return [(key, value) for key, value in leaves(record_of(trial)) if key not in before or before[key] != value]


def options_of(settings: Iterable[tuple[str, Any]]) -> list[str]:
    """Return the words of a command that ask for some settings."""
    return [word for key, value in settings for word in ("--set", f"{key}={json.dumps(value)}")]


def drawing_said(**said: Any) -> DrawingOptions:
    """Return the options of a drawing; raises UsageError for a value that means nothing."""
    try:
        return DrawingOptions(**said)
    except WorldError as error:
        raise UsageError(str(error)) from error


def drawing_settings(said: DrawingOptions, typed: Collection[str] = ()) -> Record:
    """Return, by their dotted keys, the options of a drawing that are said, and those typed with whatever value."""
    record = plain(own(said))
    return {f"drawing.{name}": record[name] for name in DRAWING if name in typed or name in said.given}


def over(base: Record, *changes: Mapping[str, Any]) -> Record:
    """Return a nested record with the changes laid over it, the last one on top."""
    result = dict(base)
    for change in changes:
        for key, value in change.items():
            both = isinstance(value, Mapping) and isinstance(result.get(key), dict)
            result[key] = over(result[key], value) if both else value
    return result


def trial_of(*changes: Mapping[str, Any]) -> TrialConfig:
    """Return the settings of a trial: the defaults with some nested records over them, the last one on top.

    Raises UsageError for a value of another type than its key's.
    """
    record = over(defaults(), *changes)
    try:
        trial: TrialConfig = fit(TrialConfig, record)
    except UnfitError as error:
        raise UsageError(f"expected settings of a trial, found {error}: {SEE}") from error
    except (RobotError, WorldError) as error:
        raise UsageError(str(error)) from error
    return trial


def defaults() -> Record:
    """Return the settings of a trial as they are where nothing else is said, as they come back from a file."""
    return record_of(TrialConfig(""))


def record_of(trial: TrialConfig) -> Record:
    """Return the settings of a trial as they come back from a file."""
    record: Record = plain(own(trial))
    return record


def own(group: Any) -> Record:
    """Return a group of settings and those within as a nested record; what the robot states stands in `robot` alone."""
    values = {each.name: getattr(group, each.name) for each in fields(group) if not each.metadata.get(STATED)}
    return {name: own(value) if is_dataclass(value) else value for name, value in values.items()}


def plain(value: Any) -> Any:
    """Return a value as it comes back from a JSON file."""
    return json.loads(json_bytes(value))


def leaves(record: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted key and the value of everything in a nested record that holds nothing itself."""
    for key, value in record.items():
        if isinstance(value, Mapping) and value:
            yield from leaves(value, f"{above}{key}.")
        else:
            yield f"{above}{key}", value


def nested(settings: Iterable[tuple[str, Any]]) -> Record:
    """Return the nested record of dotted keys and their values."""
    result: Record = {}
    for key, value in settings:
        for part in reversed(key.split(".")):
            value = {part: value}
        result = over(result, value)
    return result


def _place(key: str, value: Any) -> None:
    """Raise UnfitError where a trial has no such setting, or where the value is of another type."""
    kind: Any = TrialConfig
    parts = key.split(".")
    for depth, part in enumerate(parts):
        kind = _inner(kind)
        if kind is None:
            raise UnfitError(f"{key[:80]!r} below {'.'.join(parts[:depth])!r}, which is one value")
        hints = get_type_hints(kind)
        if part not in hints or part not in kind.__dataclass_fields__ or _is_stated(kind, part):
            if now := told_of(key):
                raise UnfitError(f"the key {key!r} of older versions (name {now})")
            if is_past(key):
                raise UnfitError(f"the key {key!r} of older versions (nothing stands for it now)")
            beside = [
                ".".join([*parts[:depth], name, *parts[depth + 1 :]]) for name in get_close_matches(part, hints, 1)
            ]
            near = beside or get_close_matches(key, [name for name, _ in leaves(defaults())], 3, 0.5)
            raise UnfitError(f"the unknown key {key[:80]!r}" + (f" (is it {' or '.join(near)}?)" if near else ""))
        kind = hints[part]
    if _inner(kind) is not None and value is not None:
        raise UnfitError(f"{key!r}, which holds several settings: name one of them")
    fit(kind, value, key)


def _is_stated(kind: Any, part: str) -> bool:
    return bool(kind.__dataclass_fields__[part].metadata.get(STATED))


def _inner(kind: Any) -> Any:
    """Return the dataclass that a type is, or may be beside None; None where it is none."""
    options = [kind, *getattr(kind, "__args__", ())]
    return next((option for option in options if isinstance(option, type) and is_dataclass(option)), None)


def _value(words: str) -> Any:
    try:
        return plain_json(words.encode(errors="surrogateescape"))
    except UnfitError as error:
        if words[:1].isalpha() and words.isprintable() and words not in ("NaN", "Infinity"):
            return words
        raise UnfitError(f"the value {words[:40]!r} ({error})") from error
