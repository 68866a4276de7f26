"""Figures, drawn by matplotlib with its own defaults: a user's MPLBACKEND or matplotlibrc does not change them."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from chainslam.slam.geometry.compiled import cache, is_users_own

BACKEND, HOME = "MPLBACKEND", "MPLCONFIGDIR"


def _loaded() -> None:
    """Import matplotlib, even if the environment names a backend that does not exist here, such as a notebook's."""
    if not is_users_own():
        os.environ.setdefault(HOME, str(cache() / "matplotlib"))
    wanted = os.environ.pop(BACKEND, None)
    try:
        import matplotlib as mpl
    finally:
        if wanted is not None:
            os.environ[BACKEND] = wanted
    if wanted:
        with suppress(ValueError, ImportError):
            mpl.rcParams["backend"] = wanted


_loaded()


@contextmanager
def own_look() -> Iterator[None]:
    """Draw with matplotlib's defaults in a block or a function."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        yield
