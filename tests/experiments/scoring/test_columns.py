"""Rows in a file without a name come back as the columns that were put in, also where the disk is full."""

import numpy as np
import pytest

from chainslam.sim.logs.columns import Columns


def rows(count):
    rng = np.random.default_rng(count)
    for k in range(count):
        yield {
            "step": k,
            "is_lost": bool(k % 3),
            "nis": float("nan") if k == 1 else float(rng.normal()),
            "pose": rng.normal(size=3),
            "cov": rng.normal(size=(3, 3)),
            "faces": rng.integers(-1, 90, 7).astype(np.int16),
        }


class FullDisk:
    """A file that takes so many writes, and half of the next."""

    def __init__(self, file, writes):
        self._file, self._writes = file, writes

    def write(self, content):
        self._writes -= 1
        if self._writes < -1:
            raise OSError(28, "No space left on device")
        return self._file.write(content if self._writes >= 0 else content[: len(content) // 2])

    def __getattr__(self, name):
        return getattr(self._file, name)


@pytest.mark.parametrize("writes", [None, 0, 1, 4])
def test_columns_are_those_of_a_list_of_rows(writes):
    columns, put = Columns(), list(rows(6))
    if writes is not None:
        columns._rows = FullDisk(columns._rows, writes)
    for k, row in enumerate(put):
        assert len(columns) == k
        columns.append(row)
        if k == 2:
            np.testing.assert_array_equal(columns.arrays()["step"], [0, 1, 2])
    found = columns.arrays()
    for name in put[0]:
        expected = np.array([row[name] for row in put])
        assert found[name].dtype == expected.dtype
        np.testing.assert_array_equal(found[name], expected)
