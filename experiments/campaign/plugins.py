"""Plug-ins with back ends, strategies and readers: found in installed packages or files, and sent to workers."""

from __future__ import annotations

import importlib.util
import sys
from collections.abc import Callable, Iterable
from dataclasses import dataclass
from functools import partial
from importlib import import_module
from importlib.metadata import entry_points
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from ..terminal.console import say
from ..usage import UsageError

if TYPE_CHECKING:
    from chainslam.explore.strategies import StrategyEntry
    from chainslam.sim.worlds import DrawingOptions
    from chainslam.sim.worlds.drawing import Drawing
    from chainslam.slam.backends import BackendEntry

Task = TypeVar("Task")
Result = TypeVar("Result")
GROUPS = {
    "chainslam.backends": ("chainslam.slam.backends", "BACKENDS"),
    "chainslam.strategies": ("chainslam.explore.strategies", "STRATEGIES"),
    "chainslam.world_formats": ("chainslam.sim.worlds.registry", "READERS"),
}
"""Groups of entry points, by which a distribution says what it adds, and the registry of each: loaded where used."""
_looked: list[bool] = []


@dataclass(frozen=True)
class OwnEntries:
    """Names that chainslam registers itself."""

    backends: dict[str, BackendEntry]
    strategies: dict[str, StrategyEntry]
    readers: dict[str, Callable[[Path, DrawingOptions], Drawing]]


def register_installed() -> None:
    """Register the entries of installed distributions, once; report and skip those that fail."""
    if _looked:
        return
    _looked.append(True)
    there = entry_points()  # reads every distribution: once, not for each group
    for group, place in GROUPS.items():
        for point in there.select(group=group):
            known = _registry(*place)
            try:
                if point.name in known:
                    raise ValueError(f"the name {point.name} is taken")
                known[point.name] = point.load()
            except Exception as error:  # a plug-in may raise anything
                whose = f" of {point.dist.name}" if point.dist else ""
                say(f"chainslam: ignored the plug-in {point.value}{whose}: {_named(error)}", stderr=True)


def register_files(paths: Iterable[Path]) -> None:
    """Run Python files that register plug-ins; raises UsageError for one that fails."""
    for path in paths:
        name = f"chainslam_plugin_{path.stem}"
        spec = importlib.util.spec_from_file_location(name, path)
        if spec is None or spec.loader is None:
            raise UsageError(f"expected a Python file (--plugin), found {path.name}: name one that ends in .py")
        if not path.is_file():
            raise UsageError(f"expected a Python file (--plugin), found no {path.name}: name one that exists")
        module, before = importlib.util.module_from_spec(spec), own_entries()
        sys.modules[name] = module
        try:
            spec.loader.exec_module(module)
        except Exception as error:  # a plug-in may raise anything
            raise UsageError(
                f"expected a plug-in that can be loaded, found {path.name}, which raises {_named(error)}: correct it"
            ) from error
        if own_entries() == before:
            raise UsageError(
                f"expected a plug-in that registers something, found {path.name}, which adds nothing to"
                " chainslam.BACKENDS, STRATEGIES or READERS: see docs/howto/extend.md"
            )
        import cloudpickle

        cloudpickle.register_pickle_by_value(module)  # a worker could not import it by its name


def own_entries() -> OwnEntries:
    """Return what plug-ins have registered in this process."""
    return OwnEntries(
        *(
            {name: entry for name, entry in _registry(*place).items() if name not in _registry(place[0], "BUILT_IN")}
            for place in GROUPS.values()
        )
    )


def with_own(perform: Callable[[Task], Result]) -> Callable[[Task], Result]:
    """Return a function that performs a task in another process with the plug-ins of this one."""
    own = own_entries()
    return perform if own == OwnEntries({}, {}, {}) else partial(_registered, own, perform)


def _registered(own: OwnEntries, perform: Callable[[Task], Result], task: Task) -> Result:
    for place, entries in zip(GROUPS.values(), (own.backends, own.strategies, own.readers), strict=True):
        _registry(*place).update(entries)
    return perform(task)


def _registry(module: str, name: str) -> Any:
    return getattr(import_module(module), name)


def _named(error: Exception) -> str:
    return f"{type(error).__name__}: {error}"
