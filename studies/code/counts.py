"""How large the code is where size hurts: numbers that one may tune, entries of a folder, arrows between files.

.venv/bin/python -m studies.code.counts            # a table
.venv/bin/python -m studies.code.counts --numbers  # every such number that is no setting, with its value and place
"""

import ast
import sys
from collections import Counter
from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import groupby, pairwise
from pathlib import Path

import grimp
import tyro
from rich.console import Console
from rich.table import Table

ROOMS = ("slam", "explore", "sim", "viz", "experiments", "studies")
TUNED = ("slam", "explore")
"""The rooms whose numbers decide what is mapped and where the robot drives."""
PLAIN = (0, 1, 2, -1)
"""Numbers in a condition that say "none", "one", "both" or "the last" and are not chosen."""
LAYOUT = ("POSE", "POSE_ROWS", "LINE_ROWS", "NANO", "ROOM", "SPARE", "TINY", "LEAST_SIGMA")
"""Constants that are no choice: shapes of arrays and files, room that is kept for more, and where arithmetic ends."""
HALF = 0.5
"""No choice either, but in a comparison: the middle of two."""
IN_CODE = """# Numbers in the code

Numbers of `slam/` and `explore/` that were chosen and are no settings (those are in docs/reference/settings.md):
constants, numbers in conditions, and all others with a decimal point but 0, 1, 2 and a half. Those without a
description guard the arithmetic or count in geometry (a ring has three corners). The table by folder counts settings,
too.
"""
NO_ENTRIES = {"__pycache__", "__init__.py", "py.typed"}


@dataclass(frozen=True)
class Number:
    """A number that one may tune."""

    file: str
    line: int
    name: str
    """`Class.field` or `CONSTANT`; for a literal the condition that it stands in."""
    value: str
    kind: str
    """`setting`, `constant` or `literal`; `layout` for what nobody would tune."""
    says: str
    """The docstring below it; empty where there is none."""


@dataclass(frozen=True)
class Asked:
    """Count, and print what was counted."""

    root: Path = Path()
    """The sources: a checkout."""
    numbers: bool = False
    """List every number that is no setting instead, in Markdown."""


def tunable(root: Path, rooms: tuple[str, ...] = TUNED) -> list[Number]:
    """Return the numbers that one may tune in the files of these rooms, in the order of files and lines."""
    found: list[Number] = []
    for room in rooms:
        for path in sorted((root / room).rglob("*.py")):
            file, tree = path.relative_to(root).as_posix(), ast.parse(path.read_text())
            found += _settings(file, tree) + _constants(file, tree) + _literals(file, tree)
    return found


def _settings(file: str, tree: ast.Module) -> list[Number]:
    return [
        Number(file, line, f"{each.name}.{name}", value, "setting", says)
        for each in ast.walk(tree)
        if isinstance(each, ast.ClassDef) and each.name.endswith(("Config", "Spec"))
        for line, name, value, says in _assigned(each.body)
    ]


def _constants(file: str, tree: ast.Module) -> list[Number]:
    return [
        Number(file, line, name, value, "layout" if name in LAYOUT else "constant", says)
        for line, name, value, says in _assigned(tree.body)
        if name.isupper()
    ]


def _assigned(body: list[ast.stmt]) -> Iterator[tuple[int, str, str, str]]:
    """Yield line, name, value and docstring of each statement that gives a name a number or some."""
    for statement, following in pairwise([*body, ast.Pass()]):
        match statement:
            case ast.AnnAssign(target=ast.Name(id=name), value=ast.expr() as value):
                pass
            case ast.Assign(targets=[ast.Name(id=name)], value=value):
                pass
            case _:
                continue
        if _is_number(value):
            match following:
                case ast.Expr(value=ast.Constant(value=str() as says)):
                    yield statement.lineno, name, ast.unparse(value), " ".join(says.split())
                case _:
                    yield statement.lineno, name, ast.unparse(value), ""


def _is_number(value: ast.expr) -> bool:
    """Return whether an expression is a number, some, or one worked out from others; arrays of nothing are none."""
    leaves = [each.value for each in ast.walk(value) if isinstance(each, ast.Constant)]
    if not leaves or any(type(each) not in (int, float) for each in leaves):
        return False
    chosen = any(each not in PLAIN for each in leaves)
    match value:
        case ast.Constant() | ast.Tuple():
            return True
        case ast.Call(func=ast.Name(id=name)) if name[0].isupper():
            return False
        case _:
            return chosen and isinstance(value, (ast.UnaryOp, ast.BinOp, ast.Call))


def _literals(file: str, tree: ast.Module) -> list[Number]:
    """Return the numbers that stand in comparisons, and those with a point that stand anywhere else in a function."""
    compared = {
        leaf: ast.unparse(each) for each in ast.walk(tree) if isinstance(each, ast.Compare) for leaf in _chosen(each)
    }
    others = {
        leaf: ast.unparse(each).splitlines()[0]
        for function in ast.walk(tree)
        if isinstance(function, ast.FunctionDef)
        for each in ast.walk(function)
        if isinstance(each, ast.stmt) and not hasattr(each, "body")
        for leaf in ast.walk(each)
        if isinstance(leaf, ast.Constant) and type(leaf.value) is float and leaf.value not in (*PLAIN, HALF)
    }
    found = sorted((others | compared).items(), key=lambda item: item[0].lineno)
    return [Number(file, leaf.lineno, place, str(leaf.value), "literal", "") for leaf, place in found]


def _chosen(comparison: ast.Compare) -> Iterator[ast.Constant]:
    """Yield the numbers that are a side of a comparison or a factor of one: not indices, not arguments of calls."""
    sides = [comparison.left, *comparison.comparators]
    while sides:
        side = sides.pop()
        match side:
            case ast.Constant(value=int() | float() as value) if type(value) is not bool and value not in PLAIN:
                yield side
            case ast.BinOp(left=left, right=right):
                sides += [left, right]
            case ast.UnaryOp(operand=operand):
                sides.append(operand)


def entries(root: Path, rooms: tuple[str, ...] = ROOMS) -> dict[str, int]:
    """Return how many entries each folder of these rooms has, but for what makes it a package."""
    folders = [path for room in rooms for path in [root / room, *(root / room).rglob("*")] if path.is_dir()]
    return {
        path.relative_to(root).as_posix(): sum(each.name not in NO_ENTRIES for each in path.iterdir())
        for path in sorted(folders)
        if path.name not in NO_ENTRIES
    }


def arrows(rooms: tuple[str, ...] = ROOMS) -> dict[str, tuple[int, int]]:
    """Return for each room how many files it has and how many imports lead from them to files of any room."""
    graph = grimp.build_graph("chainslam", "studies", cache_dir=None)
    return {
        room: (len(inside), sum(len(graph.find_modules_directly_imported_by(module)) for module in inside))
        for room in rooms
        if (inside := [module for module in graph.modules if room_of(module) == room])
    }


def room_of(module: str) -> str:
    """Return the top-level folder that a module stands in."""
    return module.removeprefix("chainslam.").partition(".")[0]


def page(numbers: Iterable[Number]) -> str:
    """Return a page in Markdown: how many numbers each folder has, and those of each file that are no settings."""
    numbers = list(numbers)
    lines = [IN_CODE, "| folder | numbers |", "|---|---|"]
    lines += [f"| `{folder}/` | {count} |" for folder, count in by_folder(numbers).items()]
    lines.append("")
    for file, found in groupby((each for each in numbers if each.kind != "setting"), lambda each: each.file):
        lines += [f"## `{file}`", "", "| name | value | what it is |", "|---|---|---|"]
        lines += [f"| `{_cell(each.name)}` | `{_cell(each.value)}` | {_cell(each.says)} |" for each in found]
        lines.append("")
    return "\n".join(lines)


def by_folder(numbers: Iterable[Number]) -> dict[str, int]:
    """Return how many numbers that one may tune each folder has; those of compiled loops count where these are used."""
    folders = (Path(each.file).parent for each in numbers if each.kind != "layout")
    return dict(Counter((each.parent if each.name == "kernels" else each).as_posix() for each in folders))


def _cell(text: str) -> str:
    return text.replace("|", "\\|")


def main() -> int:
    """Print the counts, or the numbers."""
    asked, console = tyro.cli(Asked, prog="studies.code.counts"), Console()
    numbers = tunable(asked.root)
    if asked.numbers:
        print(page(numbers), end="")
        return 0
    kinds = ("setting", "constant", "literal")
    columns = (*(f"{kind}s" for kind in kinds), "all", "without words", "and layout")
    shown = Table("room", *columns, title="Numbers that one may tune")
    for room in TUNED:
        everything = [each for each in numbers if each.file.startswith(f"{room}/")]
        own = [each for each in everything if each.kind in kinds]
        mute = sum(not each.says for each in own if each.kind != "literal")
        each_kind = (str(sum(each.kind == kind for each in own)) for kind in kinds)
        shown.add_row(room, *each_kind, str(len(own)), str(mute), str(len(everything) - len(own)))
    console.print(shown)
    folders = entries(asked.root)
    fullest = sorted(folders.items(), key=lambda item: -item[1])[:8]
    shown = Table("folder", "entries", title=f"Entries: {len(folders)} folders, the fullest")
    for folder, count in fullest:
        shown.add_row(folder, str(count))
    console.print(shown)
    shown = Table("room", "files", "imports", title="Arrows")
    for room, (files, imports) in arrows().items():
        shown.add_row(room, str(files), str(imports))
    console.print(shown)
    return 0


if __name__ == "__main__":
    sys.exit(main())
