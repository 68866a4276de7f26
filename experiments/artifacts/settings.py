"""Settings of a trial by name, from a file (`--config`) and one by one (`--set KEY=VALUE`), on top of the defaults.

Keys are those of `config.json`, with dots between levels: `mission.mapper.matching.gate`.
"""

import json
from collections.abc import Collection, Iterable, Iterator, Mapping
from contextlib import contextmanager
from dataclasses import fields, is_dataclass
from difflib import get_close_matches
from functools import cache
from pathlib import Path
from typing import Any

from chainslam.sim.worlds import DrawingOptions, WorldError
from chainslam.slam.robot import STATED, RobotError

from ..scenario import TrialConfig
from ..usage import UsageError
from .files import json_bytes
from .reading import check_format, plain_json, read_plain, told
from .schema import UnfitError, UnknownKeyError, check_keys, fit, group_of, settings_in

REMEDY = "name a run's config.json, or a JSON object with some of its keys"
NAVIGATION = "mission.explorer.following.navigation"
FOLLOWING = "mission.explorer.following.method"
KEYS = {
    **{name: name for name in ("world", "backend", "strategy", "seed", "p0", "errorless", "max_steps", "start", "map")},
    "odometry": "odometry",
    "max_path": "max_path_m",
    "time_limit": "time_limit_s",
    "sweep": "mission.explorer.sweep",
    "return_to_start": "mission.return_to_start",
    "navigation": NAVIGATION,
    "following": FOLLOWING,
}
"""Options that decide a run, and their keys in `config.json`."""
DRAWING = tuple(each.name for each in fields(DrawingOptions))
"""Options about how a world's file is read."""
SEE = "docs/reference/settings.md names all"
Record = dict[str, Any]


def read_settings(path: Path) -> Record:
    """Return the settings in a file, as a nested record: a run's whole `config.json`, or an object of some keys of one.

    Raises UsageError, in one line, for any other file, for a key that no trial has, and for a value out of its range.
    """
    with told(path, REMEDY):
        said = read_plain(path)
        if "trial" not in said:
            return some_settings(said)
        check_format(said)
        fit(TrialConfig, said["trial"], "trial")
        return dict(said["trial"])


def parse_setting(text: str) -> Record:
    """Return one `KEY=VALUE` as a nested record; raises UsageError for an unknown key or an invalid value.

    A value is JSON; anything that is not valid JSON is taken as text.
    """
    key, equals, words = text.partition("=")
    if not equals or not key:
        raise UsageError(f"expected --set KEY=VALUE, found {text[:60]!r}: use this form")
    with _asked_for("a setting"):
        return some_settings(nested([(key, _value(words))]))


def parse_settings(texts: Iterable[str]) -> Record:
    """Return several `KEY=VALUE` as a nested record, the last with priority; raises UsageError."""
    return over({}, *map(parse_setting, texts))


def settings_of(said: Mapping[str, Any]) -> Record:
    """Return settings by their dotted keys as a nested record; raises UsageError for invalid ones."""
    return parse_settings(f"{key}={json.dumps(value)}" for key, value in said.items())


def asked(file: Path | None, named: Record, settled: Collection[str]) -> Record:
    """Return what a file (--config) and settings by name (--set) ask for of a command that settles some keys itself.

    The latter go before. What is settled is left aside in a file; raises UsageError where it is named.
    """
    for key in named.keys() & set(settled):
        raise UsageError(
            f"expected --set with a key that this command leaves open, found {key!r}: use the command's own options"
        )
    base = {} if file is None else read_settings(file)
    return over({key: value for key, value in base.items() if key not in settled}, named)


def differing(trial: TrialConfig) -> list[tuple[str, Any]]:
    """Return the dotted keys and values of a trial's settings that differ from the defaults."""
    before = dict(leaves(defaults()))
    return [(key, value) for key, value in leaves(record_of(trial)) if key not in before or before[key] != value]


def options_of(settings: Iterable[tuple[str, Any]]) -> list[str]:
    """Return the command-line words for some settings."""
    return [word for key, value in settings for word in ("--set", f"{key}={json.dumps(value)}")]


def drawing_said(**said: Any) -> DrawingOptions:
    """Return the options of a drawing; raises UsageError for an invalid value."""
    try:
        return DrawingOptions(**said)
    except WorldError as error:
        raise UsageError(str(error)) from error


def drawing_settings(said: DrawingOptions, typed: Collection[str] = ()) -> Record:
    """Return, by their dotted keys, the options of a drawing that are said, and those typed with whatever value."""
    record = plain(own(said))
    return {f"drawing.{name}": record[name] for name in DRAWING if name in typed or name in said.given}


def over(base: Record, *changes: Mapping[str, Any]) -> Record:
    """Return a nested record with changes merged into it, the last with priority."""
    result = dict(base)
    for change in changes:
        for key, value in change.items():
            both = isinstance(value, Mapping) and isinstance(result.get(key), dict)
            result[key] = over(result[key], value) if both else value
    return result


def trial_of(*changes: Mapping[str, Any]) -> TrialConfig:
    """Return the settings of a trial: the defaults, updated by nested records, the last with priority.

    Raises UsageError for an unknown key or an invalid value.
    """
    with _asked_for("settings of a trial"):
        return fit(TrialConfig, over(defaults(), *changes))


@cache
def defaults() -> Record:
    """Return the default settings of a trial, as read-only."""
    return record_of(TrialConfig(""))


def record_of(trial: TrialConfig) -> Record:
    """Return the settings of a trial as they are read back from a file."""
    record: Record = plain(own(trial))
    return record


def own(group: Any) -> Record:
    """Return a group of settings as a nested record; the description of the robot stands in `robot` only."""
    values = {each.name: getattr(group, each.name) for each in fields(group) if not each.metadata.get(STATED)}
    return {name: own(value) if is_dataclass(value) else value for name, value in values.items()}


def plain(value: Any) -> Any:
    """Return a value as it comes back from a JSON file."""
    return json.loads(json_bytes(value))


def leaves(record: Mapping[str, Any], above: str = "") -> Iterator[tuple[str, Any]]:
    """Yield the dotted key and the value of every leaf of a nested record."""
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


def names() -> Iterator[str]:
    """Yield the dotted keys of all settings of a trial, and of the groups that hold them."""
    groups: list[tuple[str, Any]] = [("", TrialConfig)]
    while groups:
        above, group = groups.pop()
        for name, kind in settings_in(group).items():
            yield f"{above}{name}"
            groups += [(f"{above}{name}.", inner)] if (inner := group_of(kind)) is not None else []


def some_settings(record: Record) -> Record:
    """Return some settings as they are; raises UnfitError for a key that no trial has, or a value that it cannot."""
    try:
        check_keys(TrialConfig, record, some=True)
    except UnknownKeyError as error:
        known, group = list(names()), error.key.rpartition(".")[0]
        beside = [name for name in known if name.rpartition(".")[0] == group]
        near = get_close_matches(error.key, beside, 1, 0.8) or get_close_matches(error.key, known, 3, 0.5)
        raise UnknownKeyError(error.key, f" (is it {' or '.join(near)}?)" if near else "") from None
    return record


@contextmanager
def _asked_for(what: str) -> Iterator[None]:
    """Convert an error in settings into a UsageError."""
    try:
        yield
    except UnfitError as error:
        raise UsageError(f"expected {what}, found {error}: {SEE}") from error
    except (RobotError, WorldError) as error:
        raise UsageError(str(error)) from error


def _value(words: str) -> Any:
    try:
        return plain_json(words.encode(errors="surrogateescape"))
    except UnfitError as error:
        if words[:1].isalpha() and words.isprintable() and words not in ("NaN", "Infinity"):
            return words
        raise UnfitError(f"the value {words[:40]!r} ({error})") from error
