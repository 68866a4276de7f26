"""Figures, drawn by matplotlib with its own defaults: no MPLBACKEND and no matplotlibrc of a user changes them."""

import os
from collections.abc import Iterator
from contextlib import contextmanager, suppress

from chainslam.slam.geometry.compiled import cache, is_users_own

BACKEND, HOME = "MPLBACKEND", "MPLCONFIGDIR"


def _loaded() -> None:
    """Import matplotlib, which a backend of another environment keeps from it: that of a notebook's kernel."""
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
    """Draw with matplotlib's defaults while the block, or the function, runs."""
    import matplotlib as mpl

    with mpl.rc_context():
        mpl.rcdefaults()
        yield
