"""Rows of numbers, one a step, in a file without a name: what a run has told takes no memory while it goes on."""

import tempfile
from collections.abc import Mapping
from io import BytesIO
from typing import IO, Any

import numpy as np


class Columns:
    """Grows by a row at a time; every row has the names, the kinds and the shapes of the first."""

    def __init__(self) -> None:
        self._rows: IO[bytes] = tempfile.TemporaryFile(buffering=0)  # noqa: SIM115, closed when the columns are gone
        self._row: np.ndarray = np.zeros(0)
        self._count = 0

    def __del__(self) -> None:
        self._rows.close()

    def __len__(self) -> int:
        return self._count

    def append(self, row: Mapping[str, Any]) -> None:
        """Add a row; a disk that is full moves all of them into memory."""
        if not self._count:
            kinds = [(name, (first := np.asarray(value)).dtype, first.shape) for name, value in row.items()]
            self._row = np.zeros((), dtype=kinds)
        for name, value in row.items():
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

    def arrays(self) -> dict[str, np.ndarray]:
        """Return each column, in rows' order."""
        rows = np.frombuffer(self._content(), dtype=self._row.dtype)
        return {name: np.ascontiguousarray(rows[name]) for name in rows.dtype.names or ()}

    def _content(self) -> bytes:
        self._rows.seek(0)
        content = b"".join(iter(lambda: self._rows.read(1 << 24), b""))
        self._rows.seek(0, 2)
        return content[: self._count * self._row.dtype.itemsize]
