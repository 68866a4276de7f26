"""What is said of bad usage and bad input."""

from collections.abc import Iterable
from difflib import get_close_matches
from importlib.util import find_spec

OR_OWN = "choose one of these, or name the file of your own with --plugin"
LONGEST = 100
"""More letters than this are no typo."""


EXTRAS = {
    **dict.fromkeys(("distributed", "dask", "pyarrow"), "pip install 'chainslam[campaign]'"),
    "gtsam": "it has no wheel for every system, so choose another --backend",
    "rerun": "pip install 'chainslam[view]'",
    "rosbags": "pip install 'chainslam[ros]'",
}
"""What to do where a package is missing that not everybody needs."""


class UsageError(ValueError):
    """Bad usage or bad input, told in one line: what was expected, what was found, what to do."""

    exit_status = 2
    """What the command ends in."""


def need(package: str) -> None:
    """Raise UsageError where a package is not installed that is needed later, before anything is computed."""
    if find_spec(package) is None:
        raise missing(ImportError(name=package))


def missing(error: ImportError) -> Exception:
    """Return in one line what to do for an extra that is not installed; for any other import that fails, itself."""
    package = (error.name or "").partition(".")[0]
    return UsageError(f"expected the package {package}, found none: {EXTRAS[package]}") if package in EXTRAS else error


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
