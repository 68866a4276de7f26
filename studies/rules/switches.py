"""Switches put into the source as it is loaded: a rule is one expression, switched off it has another value.

With no switch off the program computes what it always does, to the last bit, and it is noted which switches would have
changed a value.
"""

import builtins
import os
import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Mapping, Sequence
from dataclasses import dataclass, fields, is_dataclass
from importlib.abc import MetaPathFinder
from importlib.machinery import ModuleSpec, PathFinder, SourceFileLoader
from pathlib import Path
from types import ModuleType
from typing import Any

import numpy as np
from numba import config

HERE = Path(__file__).parents[2]
PACKAGE = "chainslam."
NO = "np.zeros_like(on())"
YES = "np.ones_like(on())"
MARKS = "«»"
"""Around the expression that is the rule."""


@dataclass(frozen=True)
class Switch:
    """One rule and how to turn it off."""

    name: str
    """Module and rule, such as `matching.beside`; a rule of two places has two switches of one name."""
    module: str
    """Where it stands, below the package."""
    at: str
    """A piece of the module's source that occurs once, with marks around the expression that is the rule."""
    off: str
    """What stands there instead; `on()` is the rule's own value."""
    what: str = ""
    """What the rule does, in a few words."""

    @property
    def on(self) -> str:
        """The expression that is the rule."""
        return self.at.split(MARKS[0])[1].split(MARKS[1])[0]

    @property
    def source(self) -> str:
        """The piece of source without marks."""
        return self.at.replace(MARKS[0], "").replace(MARKS[1], "")


class State:
    """Which rules are off, and what is told of those that would have changed something."""

    def __init__(self) -> None:
        self.off: frozenset[str] = frozenset()
        self.watch: Callable[[str], bool] | None = None
        """Called when a rule of this name changes a value; returns whether the rule shall be off from here on."""

    def value(self, on: Callable[[], Any], offs: Mapping[str, Callable[[Callable[[], Any]], Any]]) -> Any:
        """Return what stands in the place of a rule, or of several that share an expression."""
        for name in self.off & offs.keys():
            return offs[name](on)
        value = on()
        if self.watch is not None:
            for name, off in offs.items():
                other = off(lambda: value)
                if not same(value, other) and self.watch(name):
                    return other
        return value


def same(one: Any, other: Any) -> bool:
    """Return whether two values are equal, arrays and records by all they hold."""
    if one is other:
        return True
    if is_dataclass(one) and is_dataclass(other):
        return all(same(getattr(one, each.name), getattr(other, each.name)) for each in fields(one))
    if isinstance(one, tuple) and isinstance(other, tuple):
        return len(one) == len(other) and all(map(same, one, other))
    if isinstance(one, np.ndarray) or isinstance(other, np.ndarray):
        return bool(np.array_equal(one, other))
    return bool(one == other)


STATE = State()


def put_in(source: str, switches: Sequence[Switch]) -> str:
    """Return a module's source with its switches; raises ValueError where a rule is not there exactly once."""
    places: dict[str, list[Switch]] = defaultdict(list)
    for switch in switches:
        places[switch.at].append(switch)
    for at, sharing in places.items():
        plain, before = sharing[0].source, at.index(MARKS[0])
        if (times := source.count(plain)) != 1:
            name = sharing[0].name
            raise ValueError(f"expected the rule {name} once in {sharing[0].module}, found it {times} times: {plain}")
        offs = ", ".join(f"{switch.name!r}: (lambda on: ({switch.off}))" for switch in sharing)
        after = at[at.index(MARKS[1]) + 1 :]
        source = source.replace(plain, f"{at[:before]}rule_switch((lambda: ({sharing[0].on})), {{{offs}}}){after}")
    return source


def source_of(module: str) -> str:
    """Return a module's source as it stands in this checkout, without loading it or its package; '' for none."""
    path = HERE.joinpath(*module.split(".")).with_suffix(".py")
    return path.read_text() if path.exists() else ""


def fitting(switches: Iterable[Switch]) -> list[Switch]:
    """Return the switches whose rule stands once in its module; name the others on stderr."""
    found = []
    for switch in switches:
        if source_of(switch.module).count(switch.source) == 1:
            found.append(switch)
        else:
            print(f"{switch.name} is not in {switch.module} any more: see studies/rules/", file=sys.stderr)
    return found


def is_kernel(switch: Switch) -> bool:
    """Return whether a rule stands in a compiled loop."""
    return "@compiled" in source_of(switch.module)


class _Loader(SourceFileLoader):
    """Loads a module with its switches, never from compiled code."""

    def __init__(self, fullname: str, path: str, switches: Sequence[Switch]) -> None:
        super().__init__(fullname, path)
        self._switches = switches

    def get_code(self, fullname: str) -> Any:
        source = self.get_data(self.path).decode()
        return compile(put_in(source, self._switches), self.path, "exec", dont_inherit=True)


class _Finder(MetaPathFinder):
    def __init__(self, switches: Iterable[Switch]) -> None:
        self._of: dict[str, list[Switch]] = defaultdict(list)
        for switch in switches:
            self._of[PACKAGE + switch.module].append(switch)

    def find_spec(
        self, fullname: str, path: Sequence[str] | None, target: ModuleType | None = None
    ) -> ModuleSpec | None:
        spec = PathFinder.find_spec(fullname, path, target) if fullname in self._of else None
        if spec is not None and spec.origin is not None:
            spec.loader = _Loader(fullname, spec.origin, self._of[fullname])
        return spec


def install(switches: Iterable[Switch]) -> None:
    """Put the switches into modules that are loaded from now on; raises RuntimeError where one is loaded already.

    Where one stands in a kernel, all kernels run as the plain Python that they are: machine code could not ask what is
    off.
    """
    chosen = list(switches)
    if any(map(is_kernel, chosen)):
        os.environ["NUMBA_DISABLE_JIT"] = "1"
        config.DISABLE_JIT = True  # type: ignore[attr-defined]
    early = {PACKAGE + switch.module for switch in chosen} & sys.modules.keys()
    if early:
        raise RuntimeError(f"expected no module with switches to be loaded yet, found {sorted(early)}")
    builtins.rule_switch = STATE.value  # type: ignore[attr-defined]
    sys.meta_path.insert(0, _Finder(chosen))
