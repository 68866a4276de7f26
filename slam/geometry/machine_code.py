"""Machine code that numba made, run without numba: to load numba takes longer than a short run computes.

What numba makes of a kernel is an object file. It asks for functions of Python and of three small extension modules of
numba, which import nothing. llvmlite links it. A file is used only by the versions and on the processor that made it.
On other systems than Linux on x86-64, numba loads what it made itself.
"""

import atexit
import builtins
import ctypes
import importlib.machinery
import importlib.util
import os
import pickle
import platform
import sys
import tempfile
from collections.abc import Callable
from functools import lru_cache
from hashlib import blake2b
from importlib.metadata import version
from pathlib import Path
from types import ModuleType
from typing import Any, NamedTuple

import numpy as np

_UNPICKLED: dict[int, Any] = {}
"""What machine code holds as pickles, by address."""
_ENVIRONMENTS: list[Any] = []
"""Machine code points to these."""
IS_KNOWN = (sys.platform, platform.machine()) == ("linux", "x86_64")
"""Elsewhere the linker wants other settings, which nobody has tried."""
_CONTIGUOUS, _LAYOUT = 0x1, 0x503
"""Flags of numpy: rows without gaps; these and columns without gaps, aligned, writable."""
_SCALARS = (float, int, bool, type(None))


class Code(NamedTuple):
    """One kernel for one kind of arguments, as numba compiled it."""

    symbol: str
    """Name of the function that takes and returns Python's objects."""
    object_file: bytes
    environments: tuple[tuple[str, list[Any]], ...]
    """Names of the variables that point to constants, and these: dtypes and classes of tuples."""


def kinds(args: tuple[Any, ...]) -> tuple[Any, ...]:
    """Return what of the arguments decides which machine code fits: types, and of arrays number type, axes, layout."""
    found: list[Any] = []
    for arg in args:
        kind = type(arg)
        if kind is np.ndarray:
            flags = arg.flags.num
            found += (arg.dtype, arg.ndim, flags & (_LAYOUT - 2 if flags & _CONTIGUOUS else _LAYOUT))
        elif isinstance(arg, tuple):
            found.append((kind, kinds(arg)))
        else:
            found.append(kind)
    return tuple(found)


def decide(args: tuple[Any, ...]) -> bool:
    """Return whether the kinds of these arguments say all that numba looks at: so with arrays, numbers, tuples."""
    return all(
        (type(arg) is np.ndarray and arg.dtype.kind in "fiub" and arg.dtype.isnative)
        or type(arg) in _SCALARS
        or isinstance(arg, (np.number, np.bool_))
        or (isinstance(arg, tuple) and decide(arg))
        for arg in args
    )


def file_of(folder: Path, function: Callable[..., object]) -> Path:
    """Return the file that keeps the machine code of a function for these versions and this processor."""
    name = function.__qualname__.replace("<locals>.", "")
    return folder / f"{name}-{function.__code__.co_firstlineno}-{_made_by()}.code"


def read(path: Path) -> dict[tuple[Any, ...], Code]:
    """Return by kinds of arguments what a file keeps; nothing where it is missing or cannot be read."""
    try:
        kept: dict[tuple[Any, ...], Code] = pickle.loads(path.read_bytes())
    except Exception:  # whatever a damaged file raises: numba makes it anew
        return {}
    return kept


def keep(path: Path, kind: tuple[Any, ...], code: Code) -> None:
    """Add one kernel to its file, unless it needs numba: for its constants, or to find what it calls."""
    constants = [each for _, held in code.environments for each in held]
    if b"numba" in pickle.dumps((kind, constants)) or b"numba.unresolved" in code.object_file:
        return
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        with tempfile.NamedTemporaryFile(dir=path.parent, delete=False) as file:
            file.write(pickle.dumps(read(path) | {kind: code}))
        os.replace(file.name, path)
    except OSError:
        return


def remembering(function: Callable[..., object]) -> Any:
    """Return numba's own cache of one function, whose `made` holds the `Code` of all that it wrote and read."""
    from numba.core import caching

    numbas: Any = caching
    made: dict[tuple[Any, ...], Code] = {}

    def remember(payload: tuple[Any, ...]) -> tuple[Any, ...]:
        (_, _, (object_file, _)), names, own, signature, *_, others = payload
        environments = tuple((each.env_name, list(each.consts)) for each in (*others, own))
        made[signature.args] = Code(names.llvm_cpython_wrapper_name, object_file, environments)
        return payload

    class Remembering(numbas.CompileResultCacheImpl):  # type: ignore[misc]
        def reduce(self, data: Any) -> Any:
            return remember(super().reduce(data))

        def rebuild(self, target_context: Any, payload: Any) -> Any:
            return super().rebuild(target_context, remember(payload))

    cache = type("Cache", (numbas.FunctionCache,), {"_impl_class": Remembering})(function)
    cache.made = made
    return cache


def linked(code: Code, function: Callable[..., Any]) -> Callable[..., Any]:
    """Return the machine code of a function, to be called as Python calls it."""
    from llvmlite import binding as llvm

    engine, dynfunc = _engine()
    engine.add_object_file(llvm.ObjectFileRef.from_data(code.object_file))
    engine.finalize_object()
    environment = None
    for name, constants in code.environments:
        environment = dynfunc.Environment(function.__globals__)
        environment.consts.extend(constants)
        _ENVIRONMENTS.append(environment)
        ctypes.c_void_p.from_address(engine.get_global_value_address(name)).value = id(environment)
    address = engine.get_function_address(code.symbol)
    module = ModuleType(function.__module__)
    made: Callable[..., Any] = dynfunc.make_function(module, function.__name__, "", address, environment, (engine,))
    return made


def _unpickled(address: int, size: int, _: int) -> Any:
    """Return the object that machine code holds at an address as a pickle: the class of the arrays that it returns."""
    if address not in _UNPICKLED:
        _UNPICKLED[address] = pickle.loads(ctypes.string_at(address, size))
    return _UNPICKLED[address]


_UNPICKLE = ctypes.PYFUNCTYPE(ctypes.py_object, ctypes.c_void_p, ctypes.c_int, ctypes.c_void_p)(_unpickled)


@lru_cache
def _engine() -> tuple[Any, Any]:
    """Return the linker, which knows the functions that machine code of numba calls, and what makes functions."""
    from llvmlite import binding as llvm

    llvm.initialize_native_target()
    llvm.initialize_native_asmprinter()
    dynfunc, helpers, runtime = map(_extension, ("_dynfunc", "_helperlib", "core.runtime._nrt_python"))
    runtime.memsys_use_cpython_allocator()
    atexit.register(runtime.memsys_shutdown)
    llvm.add_symbol("_Py_NoneStruct", id(None))
    for name, address in {**helpers.c_helpers, **dynfunc.c_helpers}.items():
        # Without the prefix: what numba takes for the sine, and for the other functions of C.
        llvm.add_symbol(name, address)
        llvm.add_symbol(f"numba_{name}", address)
    # That of numba imports numba.
    llvm.add_symbol("numba_unpickle", ctypes.cast(_UNPICKLE, ctypes.c_void_p).value)
    for name, address in runtime.c_helpers.items():
        llvm.add_symbol(name if name.startswith("_") else f"NRT_{name}", address)
    for value in vars(builtins).values():
        if isinstance(value, type) and issubclass(value, BaseException):
            llvm.add_symbol(f"PyExc_{value.__name__}", id(value))
    machine = llvm.Target.from_default_triple().create_target_machine()
    return llvm.create_mcjit_compiler(llvm.parse_assembly(""), machine), dynfunc


def _extension(name: str) -> ModuleType:
    """Return an extension module of numba without importing numba, which would import all of it."""
    whole = f"numba.{name}"
    if whole in sys.modules:
        return sys.modules[whole]
    package = importlib.util.find_spec("numba")
    folders = package.submodule_search_locations if package is not None else None
    assert folders
    spec = importlib.machinery.PathFinder.find_spec(whole, [str(Path(folders[0], *name.split(".")[:-1]))])
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    spec.loader.exec_module(module)
    return sys.modules.setdefault(whole, module)


@lru_cache
def _made_by() -> str:
    """Return one name for the versions and the processor that machine code is for."""
    from llvmlite import binding as llvm

    told = (
        version("numba"), version("llvmlite"), sys.version, np.__version__, llvm.get_host_cpu_name(),
        llvm.get_host_cpu_features().flatten(),
    )  # fmt: skip
    return blake2b(repr(told).encode(), digest_size=6).hexdigest()
