"""Loops over arrays, compiled to machine code (numba) and kept in the user's cache.

A kernel is a plain function of arrays and numbers, with `@compiled` above it: it can be read, and stepped through, as
the loop that it is. What was compiled is kept under the fingerprint of its source, of the kernels that it calls and of
the numbers that it reads, so that a changed kernel is never run as it was before.
"""

import inspect
import os
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from hashlib import blake2b
from pathlib import Path
from typing import ParamSpec, TypeVar

import numpy as np
from numba import config, njit
from numba.core.dispatcher import Dispatcher

_P = ParamSpec("_P")
_R = TypeVar("_R")
_FINGERPRINTS: dict[str, str] = {}
"""By module, of all that its kernels are made of."""
_FROZEN = (int, float, bool, str, tuple)
"""What a kernel reads of its module is compiled into it."""


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return the function compiled at its first call, or as an earlier process compiled it.

    Division by zero gives inf or NaN as in numpy, and sums are taken in the order in which they stand.
    """
    plain = inspect.unwrap(function)
    config.CACHE_DIR = str(cache() / _fingerprint(plain))  # type: ignore[attr-defined]
    return njit(cache=True, error_model="numpy")(plain)


def plain(array: np.ndarray) -> np.ndarray:
    """Return an array as kernels take it, so that each is compiled once: writable rows of doubles, without gaps."""
    if array.dtype == np.float64 and array.flags.carray:
        return array
    return np.require(array, np.float64, ("C", "A", "W"))


def is_compiled() -> bool:
    """Return whether each module of kernels that was imported so far has some in the cache."""
    return all(any((cache() / fingerprint).rglob("*.nbc")) for fingerprint in _FINGERPRINTS.values())


@lru_cache
def cache() -> Path:
    """Return the folder that keeps what was compiled: of the user, or a passing one where that cannot be written."""
    home = Path(os.environ.get("NUMBA_CACHE_DIR") or _user_cache() / "chainslam")
    try:
        home.mkdir(parents=True, exist_ok=True)
        with tempfile.TemporaryFile(dir=home):
            return home
    except OSError:
        return Path(tempfile.mkdtemp(prefix="chainslam-"))


def _user_cache() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))


def _fingerprint(function: Callable[..., object]) -> str:
    """Return one name for all that the kernels of the function's module are made of, known once they are defined."""
    module = function.__module__
    if module not in _FINGERPRINTS:
        told = blake2b(Path(function.__code__.co_filename).read_bytes(), digest_size=8)
        for name, value in sorted(function.__globals__.items()):
            if name.startswith("__"):
                continue
            if isinstance(value, _FROZEN):
                told.update(f"{name}={value!r};".encode())
            if isinstance(value, Dispatcher):
                told.update(_FINGERPRINTS[value.py_func.__module__].encode())
        _FINGERPRINTS[module] = f"{module}-{told.hexdigest()}"
    return _FINGERPRINTS[module]
