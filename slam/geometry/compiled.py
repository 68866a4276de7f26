"""Loops over arrays, compiled to machine code (numba) and kept in the user's cache.

A kernel is a plain function of arrays and numbers, with `@compiled` above it: it can be read, and stepped through, as
the loop that it is. numba keeps the machine code of a function as long as its own file stays as it is; so that a kernel
is compiled anew, too, when one that it calls has changed, the folder is named by all that a file of kernels is made of.
numba is imported when the first kernel is called: a command that calls none starts without it.
"""

import atexit
import inspect
import logging
import os
import shutil
import stat
import sys
import tempfile
from collections.abc import Callable
from functools import cached_property, lru_cache, update_wrapper
from hashlib import blake2b
from pathlib import Path
from threading import local
from time import thread_time
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np

_P = ParamSpec("_P")
_R = TypeVar("_R")
_KERNELS: list["Kernel[..., Any]"] = []


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return the function compiled at its first call, or as an earlier process compiled it.

    Division by zero gives inf or NaN as in numpy, and sums are taken in the order in which they stand.
    It must not call itself: numba crashes where it loads such code (its issue 6061).
    """
    return Kernel(inspect.unwrap(function))


class Kernel(Generic[_P, _R]):
    """A function that numba compiles when it is called, together with the kernels that it calls."""

    def __init__(self, plain: Callable[_P, _R]) -> None:
        self.plain = plain
        update_wrapper(self, plain)
        _KERNELS.append(self)

    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Run the machine code."""
        return self.machine(*args, **kwargs)

    @cached_property
    def machine(self) -> Callable[_P, _R]:
        """The function as numba calls it; itself where compiling is switched off (`NUMBA_DISABLE_JIT=1`)."""
        numba, _ = _numba()
        others, numba.config.CACHE_DIR = numba.config.CACHE_DIR, str(cache() / _made_of(self.plain))
        try:
            made: Callable[_P, _R] = numba.njit(cache=True, error_model="numpy")(self.plain)
        finally:
            numba.config.CACHE_DIR = others
        return made


@lru_cache
def _numba() -> tuple[Any, Any]:
    """Return numba, told of kernels that others call, and what counts the time of each thread in its compiler."""
    import numba
    from numba.core import event as events
    from numba.extending import typeof_impl

    class Watch(events.Listener, local):
        depth, began_s, spent_s = 0, 0.0, 0.0

        def on_start(self, event: Any) -> None:
            if event.kind == "numba:compile" and event.data["dispatcher"].py_func in [each.plain for each in _KERNELS]:
                _tell_once()
            if self.depth == 0:
                self.began_s = thread_time()
            self.depth += 1

        def on_end(self, event: Any) -> None:
            self.depth -= 1
            if self.depth == 0:
                self.spent_s += thread_time() - self.began_s

    watch = Watch()
    for kind in ("numba:compile", "numba:compiler_lock"):
        events.register(kind, watch)  # type: ignore[no-untyped-call]
    typeof_impl.register(Kernel)(lambda kernel, _: numba.types.Dispatcher(kernel.machine))
    return numba, watch


def compiling_s() -> float:
    """Return the processor time so far, s, in which this thread compiled, or loaded what was compiled."""
    spent_s: float = _numba()[1].spent_s
    return spent_s


def prepare_kernels() -> None:
    """Let numba know all kernels imported so far, so that the time of no step counts it."""
    for kernel in _KERNELS:
        kernel.machine  # noqa: B018


@lru_cache
def _made_of(function: Callable[..., object]) -> str:
    """Return one name for all that the kernels of the function's file are made of.

    It counts the file's text, the kernels that the file imports, and the numbers, enumerations and fields of tuples.
    """
    told = blake2b(Path(inspect.getfile(function)).read_bytes(), digest_size=8)
    held: dict[str, Any] = function.__globals__
    for name, value in sorted(held.items()):
        if isinstance(value, Kernel) and value.plain.__module__ != function.__module__:
            told.update(_made_of(value.plain).encode())
        elif isinstance(value, (int, float, str, tuple, type)) and not name.startswith("__"):
            inside = getattr(value, "_fields", ()), getattr(value, "__members__", ())
            told.update(repr((name, value, *inside)).encode())
    return f"{function.__module__}-{told.hexdigest()}"


@lru_cache
def _tell_once() -> None:
    home = cache()
    if is_users_own():
        told = f"once and for a minute or less; what comes of it is kept in {home}"
    elif home == _private():
        told = f"once and for a minute or less; what comes of it is kept in {home}, since {_wanted()} cannot be written"
    else:
        told = f"at every start: {_wanted()} cannot be written; let NUMBA_CACHE_DIR name a folder that can"
    logging.getLogger("chainslam").warning("chainslam: compiling loops, %s", told)


def plain(array: np.ndarray) -> np.ndarray:
    """Return an array as kernels take it, so that each is compiled once: writable rows of doubles, without gaps."""
    if array.dtype == np.float64 and array.flags.carray:
        return array
    return np.require(array, np.float64, ("C", "A", "W"))


@lru_cache
def cache() -> Path:
    """Return the folder that keeps what was compiled.

    It is that of the user's cache or, where that cannot be written, one of the user's own among the temporary files,
    which the next start finds again. Where that cannot be, either, a folder that goes when the process ends.
    """
    for home in (_wanted(), _private()):
        try:
            home.mkdir(mode=0o700, parents=True, exist_ok=True)
            if home == _private() and not _is_ours(home):
                continue
            with tempfile.TemporaryFile(dir=home):
                return home
        except OSError:
            continue
    passing = Path(tempfile.mkdtemp(prefix="chainslam-"))
    atexit.register(shutil.rmtree, passing, ignore_errors=True)
    return passing


def is_users_own() -> bool:
    """Return whether what was compiled is kept where it is meant to be."""
    return cache() == _wanted()


def _wanted() -> Path:
    return Path(os.environ.get("NUMBA_CACHE_DIR") or _user_cache() / "chainslam")


def _private() -> Path:
    """Return a folder among the temporary files that has the user's number in its name."""
    return Path(tempfile.gettempdir()) / f"chainslam-{os.getuid() if hasattr(os, 'getuid') else 'user'}"


def _is_ours(folder: Path) -> bool:
    """Return whether nobody else has made a folder, or may write to it: machine code is run that lies there."""
    found = folder.lstat()
    mine = not hasattr(os, "getuid") or found.st_uid == os.getuid()
    return stat.S_ISDIR(found.st_mode) and mine and not found.st_mode & 0o077


def _user_cache() -> Path:
    if sys.platform == "win32":
        return Path(os.environ.get("LOCALAPPDATA", Path.home() / "AppData" / "Local"))
    if sys.platform == "darwin":
        return Path.home() / "Library" / "Caches"
    return Path(os.environ.get("XDG_CACHE_HOME", Path.home() / ".cache"))
