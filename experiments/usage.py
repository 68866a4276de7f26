"""Errors for bad usage and bad input."""

from collections.abc import Iterable
from difflib import get_close_matches
from importlib.util import find_spec

OR_OWN = "choose one of these, or load your own with --plugin FILE"
LONGEST = 100
"""Longer words are not treated as typos."""


EXTRAS = {
    **dict.fromkeys(("distributed", "dask", "pyarrow"), "pip install 'chainslam[campaign]'"),
    "gtsam": "there is no wheel for some systems, so choose another --backend",
    "rerun": "pip install 'chainslam[view]'",
    "gymnasium": "pip install 'chainslam[gym]'",
    "rosbags": "pip install 'chainslam[ros]'",
}
"""What to do if an optional package is missing."""


class UsageError(ValueError):
    """Bad usage or bad input. The message is one line: what was expected, what was found, what to do."""

    exit_status = 2
    """Exit status of the command."""


def need(package: str) -> None:
    """Raise UsageError, before anything is computed, if a package that is needed later is not installed."""
    if find_spec(package) is None:
        raise missing(ImportError(name=package))


def missing(error: ImportError) -> Exception:
    """Return the UsageError for an optional package that is not installed; other errors are returned as they are."""
    package = (error.name or "").partition(".")[0]
    return UsageError(f"expected the package {package}, found none: {EXTRAS[package]}") if package in EXTRAS else error


def choose(kind: str, name: str, known: Iterable[str], remedy: str = "choose one of these") -> str:
    """Return `name` if it is known; raises UsageError otherwise."""
    names = list(known)
    if name not in names:
        near = did_you_mean(name, names)
        raise UsageError(f"expected a {kind} from {', '.join(names)}, found {name!r}{near}: {remedy}")
    return name


def did_you_mean(name: str, known: Iterable[str]) -> str:
    """Return a suggestion of the known name that is most similar to `name`, in brackets; empty if none is."""
    names = {each.lower(): each for each in known}
    # The beginning of a name is similar to it, however much is missing.
    begun = [each for each in names if len(name) > 2 and each.startswith(name.lower())]
    near = begun or get_close_matches(name.lower()[:LONGEST], names, n=1)
    return f" (did you mean {names[near[0]]}?)" if near else ""
