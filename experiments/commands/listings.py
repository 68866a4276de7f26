"""`chainslam worlds | backends | strategies`: what there is, one name first on each line.

Each listing imports only the registry that it prints.
"""

from dataclasses import dataclass


@dataclass(frozen=True)
class Worlds:
    """List the bundled worlds and families of worlds."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from sim.worlds import listing

        return _print(listing())


@dataclass(frozen=True)
class Backends:
    """List the estimators."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from slam.backends import BACKENDS

        return _print({name: entry.description for name, entry in BACKENDS.items()})


@dataclass(frozen=True)
class Strategies:
    """List the exploration strategies."""

    def run(self) -> int:
        """Print the listing and return the exit status."""
        from explore.strategies import STRATEGIES

        return _print({name: entry.description for name, entry in STRATEGIES.items()})


def _print(descriptions: dict[str, str]) -> int:
    width = max(len(name) for name in descriptions)
    for name, description in descriptions.items():
        print(f"{name:<{width}}  {description}")
    return 0
