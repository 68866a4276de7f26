"""Back ends, strategies and readers of a user's own, taken along to the processes that run a campaign's trials."""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import TypeVar

from chainslam.explore import strategies
from chainslam.explore.strategies import STRATEGIES, StrategyEntry
from chainslam.sim.worlds import DrawingOptions, registry
from chainslam.sim.worlds.drawing import Drawing
from chainslam.sim.worlds.registry import READERS
from chainslam.slam import backends
from chainslam.slam.backends import BACKENDS, BackendEntry

Task = TypeVar("Task")
Result = TypeVar("Result")


@dataclass(frozen=True)
class OwnEntries:
    """What a user has registered besides what comes along."""

    backends: dict[str, BackendEntry]
    strategies: dict[str, StrategyEntry]
    readers: dict[str, Callable[[Path, DrawingOptions], Drawing]]


def own_entries() -> OwnEntries:
    """Return what is registered in this process beyond what comes along."""
    return OwnEntries(
        {name: entry for name, entry in BACKENDS.items() if name not in backends.BUILT_IN},
        {name: entry for name, entry in STRATEGIES.items() if name not in strategies.BUILT_IN},
        {name: reader for name, reader in READERS.items() if name not in registry.BUILT_IN},
    )


def with_own(perform: Callable[[Task], Result]) -> Callable[[Task], Result]:
    """Return what performs a task in another process as this one would, with all that is registered here."""
    own = own_entries()
    return perform if own == OwnEntries({}, {}, {}) else partial(_registered, own, perform)


def _registered(own: OwnEntries, perform: Callable[[Task], Result], task: Task) -> Result:
    BACKENDS.update(own.backends)
    STRATEGIES.update(own.strategies)
    READERS.update(own.readers)
    return perform(task)
