"""Rows of numbers, stored in an unnamed file during a run."""

import tempfile
from collections.abc import Mapping
from io import BytesIO
from typing import IO, Any

import numpy as np


class Columns:
    """Rows of numbers, with names, types and shapes of the first, in an unnamed file: they use no memory."""

    def __init__(self) -> None:
        self._rows: IO[bytes] = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115, closed when the columns are gone
        self._row: np.ndarray = np.zeros(0)
        self._count = 0

    def __del__(self) -> None:
        self._rows.close()

    def __len__(self) -> int:
        return self._count

    def append(self, row: Mapping[str, Any]) -> None:
        """Add a row; if the disk is full, all rows move to memory."""
        if not self._count:
            kinds = [(name, (first := np.asarray(value)).dtype, first.shape) for name, value in row.items()]
            self._row = np.zeros((), dtype=kinds)
        self._widen(row)
        for name, value in row.items():
            cell, count = self._row[name], np.size(value)
            if cell.ndim == 1 and count < cell.size:
                cell[:count], cell[count:] = value, _nothing(cell.dtype)
            else:
                self._row[name] = value
        content = self._row.tobytes()
        try:
            whole = self._rows.write(content) == len(content)
        except OSError:
            whole = False
        if not whole:
            kept = self._content()
            self._rows.close()
            self._rows = BytesIO()
            self._rows.write(kept + content)
        self._count += 1

    def _widen(self, row: Mapping[str, Any]) -> None:
        """Make room for longer rows: a scanner may give one more reading in one turn than in the next."""
        kinds = self._row.dtype
        names = kinds.names or ()
        longer = {
            name: np.size(row[name])
            for name in names
            if kinds[name].shape and np.size(row[name]) > kinds[name].shape[0]
        }
        longer = {name: size for name, size in longer.items() if len(kinds[name].shape) == 1}
        if not longer:
            return
        wide = np.dtype([(n, kinds[n].base, (longer[n],) if n in longer else kinds[n].shape) for n in names])
        old = np.frombuffer(self._content(), dtype=kinds)
        new = np.zeros(len(old), dtype=wide)
        for name in names:
            if name in longer:
                new[name] = _nothing(kinds[name].base)
                new[name][:, : kinds[name].shape[0]] = old[name]
            else:
                new[name] = old[name]
        self._row = np.zeros((), dtype=wide)
        self._rows.seek(0)
        self._rows.truncate()
        self._rows.write(new.tobytes())

    def arrays(self) -> dict[str, np.ndarray]:
        """Return each column, in the order of the rows."""
        rows = np.frombuffer(self._content(), dtype=self._row.dtype)
        return {name: np.ascontiguousarray(rows[name]) for name in rows.dtype.names or ()}

    def _content(self) -> bytes:
        self._rows.seek(0)
        content = b"".join(iter(lambda: self._rows.read(1 << 24), b""))
        self._rows.seek(0, 2)
        return content[: self._count * self._row.dtype.itemsize]


def _nothing(kind: np.dtype) -> float | int:
    """Return the padding of a row: NaN, or -1 if the type has none."""
    return float("nan") if kind.kind == "f" else -1
