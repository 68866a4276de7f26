"""What is said of bad usage and bad input."""

from collections.abc import Iterable


class UsageError(ValueError):
    """Bad usage or bad input, told in one line: what was expected, what was found, what to do."""

    exit_status = 2
    """What the command ends in."""


def choose(kind: str, name: str, known: Iterable[str]) -> str:
    """Return `name` if it is known; raises UsageError otherwise."""
    names = list(known)
    if name not in names:
        raise UsageError(f"expected a {kind} out of {', '.join(names)}, found {name!r}: choose one of these")
    return name
