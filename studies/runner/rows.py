"""A file of rows, a line of JSON each, written as they come: a study begun again goes on where it was interrupted."""

import ast
import hashlib
import json
import os
from collections import Counter
from collections.abc import Callable, Hashable, Iterable, Iterator, Sequence
from functools import lru_cache
from pathlib import Path
from typing import Any, TypeVar

from rich.progress import track

from chainslam.experiments.campaign.workers import on_workers
from chainslam.experiments.terminal.console import plain_console
from chainslam.experiments.usage import UsageError

HERE = Path(__file__).parents[2]
ALIKE = Path(__file__).with_name("alike.jsonl")
"""Versions of the code that drive as older ones do, bit for bit (`studies.runner.alike`)."""
Row = dict[str, Any]
Key = tuple[Any, ...]
Task = TypeVar("Task", bound=Hashable)


def rows_of(
    path: Path,
    names: Sequence[str],
    tasks: Iterable[tuple[Task, Sequence[Key]]],
    perform: Callable[[Task], Sequence[Row]],
    jobs: int,
    any_code: bool = False,
) -> Iterator[Row]:
    """Yield the rows of all tasks: those that the file has, then the others, each written as it comes.

    `names` are what a row is known by; beside each task stand the keys of its rows. Rows of other code stay in the
    file, and count only with `any_code`, the newest of each key. Raises UsageError for a file of something else.
    """
    there = {key_of(row, names): row for row in read(path, names, any_code)}
    missing = []
    for task, keys in tasks:
        if all(key in there for key in keys):
            yield from (there[key] for key in keys)
        else:
            missing.append(task)
    done = map(perform, missing) if jobs <= 1 else on_workers(perform, _lost, jobs)(missing)
    for rows in track(done, "running", len(missing), console=plain_console(stderr=True), transient=True):
        yield from append(path, rows)


def key_of(row: Row, names: Sequence[str]) -> Key:
    """Return what a row is known by; raises KeyError where it lacks a part."""
    return tuple(row[name] for name in names)


def read(path: Path, names: Sequence[str] = (), any_code: bool = False) -> list[Row]:
    """Return the rows of this code, or of any, in a file, none where there is none.

    Raises UsageError for a file of other things. The last line is left out where it was cut short by a crash.
    """
    if not path.exists():
        return []
    content = path.read_bytes()
    try:
        rows = [json.loads(line) for line in content[: content.rfind(b"\n") + 1].splitlines()]
        for row in rows:
            key_of(row, ("code", *names))
    except (ValueError, KeyError, TypeError) as error:
        raise UsageError(
            f"expected rows with {', '.join(names)} in {path}, found {error!r}: name another --out"
        ) from error
    newer = {} if path == ALIKE else newer_names()
    rows = [row | {"code": newer.get(row["code"], row["code"])} for row in rows]
    return [row for row in rows if any_code or row["code"] == fingerprint()]


@lru_cache
def newer_names() -> dict[str, str]:
    """Return for each version of the code by which a newer one drives alike the name of the newest such one."""
    newer: dict[str, str] = {}
    for row in reversed(read(ALIKE, ("as",), any_code=True)):
        code: str = row["code"]
        newer.setdefault(row["as"], newer.get(code, code))
    return newer


def newest(path: Path, each: str = "") -> list[Row]:
    """Return the rows of the code that has most of them in a file, the last one where several have.

    With `each`, of every value under this name: what is made one by one may be of several codes.
    """
    groups: dict[str, list[Row]] = {}
    for row in read(path, any_code=True):
        groups.setdefault(row[each] if each else "", []).append(row)
    counts = {name: Counter(row["code"] for row in reversed(rows)) for name, rows in groups.items()}
    return [row for name, rows in groups.items() for row in rows if row["code"] == counts[name].most_common(1)[0][0]]


def last(path: Path, names: Sequence[str]) -> list[Row]:
    """Return the last row of each key in a file, of whatever code."""
    return list({key_of(row, names): row for row in read(path, names, any_code=True)}.values())


def append(path: Path, rows: Iterable[Row]) -> list[Row]:
    """Add rows to a file, each with the fingerprint of the code, in place of a line that was cut short; return them."""
    written = [{"code": fingerprint()} | row for row in rows]
    path.parent.mkdir(parents=True, exist_ok=True)
    with path.open("ab+") as file:
        if file.tell():
            file.seek(-1, os.SEEK_END)
            if file.read() != b"\n":
                file.seek(0)
                file.truncate(file.read().rfind(b"\n") + 1)
        file.writelines(json.dumps(row).encode() + b"\n" for row in written)
    return written


@lru_cache
def fingerprint(folder: Path = HERE) -> str:
    """Return a fingerprint of the code that decides a trial: its comments and docstrings decide nothing."""
    digest = hashlib.sha256()
    for room in ("slam", "explore", "sim"):
        for path in sorted((folder / room).rglob("*.py")):
            digest.update(code_alone(path.read_text()).encode())
    return digest.hexdigest()[:12]


def code_alone(source: str) -> str:
    """Return a module's source without comments and without strings that stand by themselves."""
    return ast.unparse(_WordsOut().visit(ast.parse(source)))


class _WordsOut(ast.NodeTransformer):
    def visit_Expr(self, node: ast.Expr) -> ast.Expr | None:
        return None if isinstance(node.value, ast.Constant) and isinstance(node.value.value, str) else node


def _lost(task: Task, reason: str) -> Sequence[Row]:
    raise RuntimeError(f"expected rows of {task}, found none: {reason}")
