"""One input of a kind: what reads it, what has to come of it, and what came."""

from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from chainslam.experiments.usage import UsageError
from chainslam.sim.logs.recorded_robot import RecordingError
from chainslam.sim.worlds import WorldError

Rng = np.random.Generator
REFUSALS = (UsageError, RecordingError, WorldError)
"""What the command line tells in one line, with exit status 2."""


@dataclass(frozen=True)
class Case:
    """One input."""

    read: Callable[[], Any]
    """Reads it; raises one of the refusals."""
    check: Callable[[Any], str] = lambda found: ""
    """Says in words what is wrong with what was read."""
    refused: str = ""
    """Words of the refusal that has to come; nothing where it has to be read."""


Kind = Callable[[Rng, Path], Case]
"""Makes one input in a folder of its own."""


def verdict(case: Case) -> tuple[str, str]:
    """Return `right`, `refused` or `wrong`, and in words what is wrong."""
    try:
        found = case.read()
    except REFUSALS as error:
        told = str(error)
        if "\n" in told or not told.startswith("expected ") or "found " not in told:
            return "wrong", f"refused in other words than expected, found, what to do: {told}"
        return ("refused", "") if case.refused and case.refused in told else ("wrong", f"refused: {told}")
    except Exception as error:
        return "wrong", f"{type(error).__name__}: {error}"
    if case.refused:
        return "wrong", f"read, where it was to be refused with {case.refused!r}"
    fault = case.check(found)
    return ("wrong", fault) if fault else ("right", "")


def pick(rng: Rng, items: Any) -> Any:
    """Return one of some things."""
    return items[int(rng.integers(len(items)))]
