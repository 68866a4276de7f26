"""Loops over arrays, compiled to machine code (numba) and kept in the user's cache.

A kernel is a plain function of arrays and numbers, with `@compiled` above it: it can be read, and stepped through, as
the loop that it is. What was compiled is kept under the fingerprint of its source, of the kernels that it calls and of
the numbers that it reads, so that a changed kernel is never run as it was before. numba is imported only to compile:
what an earlier process kept runs without it (`machine_code.py`).
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
from functools import lru_cache, update_wrapper
from hashlib import blake2b
from pathlib import Path
from time import thread_time
from typing import Any, Generic, ParamSpec, TypeVar

import numpy as np

from .machine_code import IS_KNOWN, decide, file_of, keep, kinds, linked, read, remembering

_P = ParamSpec("_P")
_R = TypeVar("_R")
_FINGERPRINTS: dict[str, str] = {}
"""By module, of all that its kernels are made of."""
_KERNELS: list["Kernel[..., Any]"] = []
_SPENT_S = [0.0]
_FROZEN = (int, float, bool, str, tuple)
"""What a kernel reads of its module is compiled into it."""


def compiled(function: Callable[_P, _R]) -> Callable[_P, _R]:
    """Return the function compiled at its first call, or as an earlier process compiled it.

    Division by zero gives inf or NaN as in numpy, and sums are taken in the order in which they stand.
    """
    return Kernel(inspect.unwrap(function))


class Kernel(Generic[_P, _R]):
    """A function that becomes machine code when it is called, together with the kernels that it calls."""

    def __init__(self, plain: Callable[_P, _R]) -> None:
        self.plain = plain
        self._machine: Callable[_P, _R] | None = None
        self._made: dict[tuple[Any, ...], Callable[..., _R]] | None = None
        update_wrapper(self, plain)
        _KERNELS.append(self)

    def __call__(self, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Run the machine code."""
        if self._made is None:
            self.link()
            assert self._made is not None
        code = self._made.get(kinds(args))
        return self._by_numba(*args, **kwargs) if code is None or kwargs else code(*args)

    def link(self) -> None:
        """Link what an earlier process kept, before the first call."""
        if self._made is None:
            file = self._file()
            self._made = {} if file is None else {kind: linked(code, self.plain) for kind, code in read(file).items()}

    def _by_numba(self, *args: _P.args, **kwargs: _P.kwargs) -> _R:
        """Run what numba compiles or loads, and keep it so that the next process does without numba."""
        began, known = thread_time(), self._known()
        machine: Any = self.machine()
        result: _R = machine(*args, **kwargs)
        if self._known() != known:
            _SPENT_S[0] += thread_time() - began
        if (file := self._file()) is not None and not kwargs and decide(args):
            types = tuple(map(machine.typeof_pyval, args))
            if types in machine.overloads and types in machine._cache.made:
                assert self._made is not None
                self._made[kinds(args)] = machine.overloads[types].entry_point
                keep(file, kinds(args), machine._cache.made[types])
        return result

    def _known(self) -> int:
        """Return for how many kinds of arguments numba has machine code here."""
        machine: Any = self._machine
        return -1 if machine is None else len(getattr(machine, "overloads", ()))

    def _file(self) -> Path | None:
        """Return where the machine code is kept, or None where numba has to load it."""
        if not IS_KNOWN or self.plain.__closure__ or os.environ.get("NUMBA_DISABLE_JIT", "0") != "0":
            return None
        return file_of(cache() / _fingerprint(self.plain), self.plain)

    def machine(self) -> Callable[_P, _R]:
        """Return the function as numba compiles it at a call."""
        if self._machine is None:
            from numba import config, njit

            fingerprint = _fingerprint(self.plain)
            if not config.DISABLE_JIT and not any((cache() / fingerprint).rglob("*.nbc")):  # type: ignore[attr-defined]
                _tell_once()
            config.CACHE_DIR = str(cache() / fingerprint)  # type: ignore[attr-defined]
            self._machine = njit(cache=True, error_model="numpy")(self.plain)
            if not config.DISABLE_JIT:  # type: ignore[attr-defined]
                self._machine._cache = remembering(self.plain)  # type: ignore[attr-defined]
            _let_numba_call_kernels()
        assert self._machine is not None
        return self._machine


def compiling_s() -> float:
    """Return the processor time so far, s, of first calls, in which numba is loaded and compiles."""
    return _SPENT_S[0]


def link_kernels() -> None:
    """Link what earlier processes kept of all kernels imported so far, so that the time of no step counts it."""
    for kernel in _KERNELS:
        kernel.link()


@lru_cache
def _let_numba_call_kernels() -> None:
    """Let numba take a kernel that another one calls for what it makes of it."""
    from numba import types
    from numba.extending import typeof_impl

    typeof_impl.register(Kernel)(lambda kernel, _: types.Dispatcher(kernel.machine()))


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


def _globals(function: Callable[..., object]) -> list[tuple[str, Any]]:
    """Return by name what the function's module holds, without what Python puts there."""
    held: dict[str, Any] = function.__globals__
    return [(name, value) for name, value in sorted(held.items()) if not name.startswith("__")]


def _fingerprint(function: Callable[..., object]) -> str:
    """Return one name for all that the kernels of the function's module are made of."""
    module = function.__module__
    if module not in _FINGERPRINTS:
        path = inspect.getfile(function)
        # numba keeps the machine code of each place by itself: another installation compiles anew, and says so.
        told = blake2b(os.fsencode(path) + Path(path).read_bytes(), digest_size=8)
        for name, value in _globals(function):
            if isinstance(value, _FROZEN):
                told.update(f"{name}={value!r};".encode())
            if isinstance(value, type) and issubclass(value, tuple):
                told.update(f"{name}{getattr(value, '_fields', ())};".encode())
            if isinstance(value, Kernel) and value.plain.__module__ != module:
                told.update(_fingerprint(value.plain).encode())
        _FINGERPRINTS[module] = f"{module}-{told.hexdigest()}"
    return _FINGERPRINTS[module]
