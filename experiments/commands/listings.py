"""`chainslam worlds | backends | strategies`: what there is, one name first on each line."""

from dataclasses import dataclass

from explore.strategies import STRATEGIES
from sim.worlds import listing
from slam.backends import BACKENDS


@dataclass(frozen=True)
class Worlds:
    """List the bundled worlds and families of worlds."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        return _print(listing())


@dataclass(frozen=True)
class Backends:
    """List the estimators."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        return _print({name: entry.description for name, entry in BACKENDS.items()})


@dataclass(frozen=True)
class Strategies:
    """List the exploration strategies."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        return _print({name: entry.description for name, entry in STRATEGIES.items()})


def _print(descriptions: dict[str, str]) -> int:
    width = max(len(name) for name in descriptions)
    for name, description in descriptions.items():
        print(f"{name:<{width}}  {description}")
    return 0
