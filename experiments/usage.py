"""What is said of bad usage and bad input."""

from collections.abc import Iterable
from difflib import get_close_matches

OR_OWN = "choose one of these, or name the file of your own with --plugin"
LONGEST = 100
"""More letters than this are no typo."""


class UsageError(ValueError):
    """Bad usage or bad input, told in one line: what was expected, what was found, what to do."""

    exit_status = 2
    """What the command ends in."""


def choose(kind: str, name: str, known: Iterable[str], remedy: str = "choose one of these") -> str:
    """Return `name` if it is known; raises UsageError otherwise."""
    names = list(known)
    if name not in names:
        near = did_you_mean(name, names)
        raise UsageError(f"expected a {kind} out of {', '.join(names)}, found {name!r}{near}: {remedy}")
    return name


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a question after the known name that is nearest to `name`, in brackets; nothing where none is near."""
    names = {each.lower(): each for each in known}
    # A name that was begun is near to what it begins, however much is missing.
    begun = [each for each in names if len(name) > 2 and each.startswith(name.lower())]
    near = begun or get_close_matches(name.lower()[:LONGEST], names, n=1)
    return f" (did you mean {names[near[0]]}?)" if near else ""
