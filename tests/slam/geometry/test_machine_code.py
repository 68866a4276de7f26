"""Machine code that runs without numba does what the plain loop does, for the arguments that it was made for only."""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from chainslam.slam.geometry import machine_code
from chainslam.slam.geometry.machine_code import decide, kinds

pytestmark = pytest.mark.skipif(not machine_code.IS_KNOWN, reason="numba loads machine code by itself here")
KERNELS = """
from typing import NamedTuple
import numpy as np
from chainslam.slam.geometry.compiled import compiled
class Pair(NamedTuple):
    sums: np.ndarray
    largest: float
@compiled
def described(rows, factor, held):
    sums = np.zeros(len(rows))
    for i in range(len(rows)):
        for j in range(rows.shape[1]):
            sums[i] += factor * rows[i, j] * held.largest
    return Pair(sums, np.exp(sums.max())), sums > 0.0
@compiled
def depth(n):
    return 0 if n == 0 else 1 + depth(n - 1)
"""
CALLS = """
import sys
import numpy as np
from its_kernels import Pair, depth, described
rows = np.arange(6.0).reshape(2, 3) - 2.0
many = [rows, rows[:, ::-1], np.asfortranarray(rows), rows.astype(np.float32), rows.astype(int), rows.astype(">f8")]
many += [np.broadcast_to(rows, (2, 3)), rows[:1], rows[:, :1]]
held = Pair(np.ones(1), 2.0)
for rows in many[: int(sys.argv[1])]:
    for factor in (0.5, 2, True, np.float32(0.5)):
        try:
            pair, positive = described(rows, factor, held)
            expected, over = described.plain(rows, factor, held)
            assert type(pair) is Pair
            np.testing.assert_array_equal(pair.sums, expected.sums)
            np.testing.assert_array_equal(positive, over)
            assert pair.largest == expected.largest
        except Exception as error:
            print(type(error).__name__)
print("numba" in sys.modules)
if len(sys.argv) > 2:
    print(depth(5), "numba" in sys.modules)
"""


def run(folder: Path, *words: str, **environment: str) -> list[str]:
    (folder / "its_kernels.py").write_text(KERNELS)
    (folder / "calls.py").write_text(CALLS)
    around = {"PYTHONPATH": f"{Path(__file__).parents[3]}:{folder}", "NUMBA_CACHE_DIR": str(folder / "cache")}
    return subprocess.run(
        [sys.executable, *(words if words[0] == "-c" else ("calls.py", *words))],
        cwd=folder, env=os.environ | around | environment, capture_output=True, text=True, check=True,
    ).stdout.split()  # fmt: skip


def test_what_was_compiled_runs_without_numba_and_other_arguments_get_code_of_their_own(tmp_path: Path) -> None:
    assert run(tmp_path, "1") == ["True"]
    assert run(tmp_path, "1") == ["False"]
    # Strides, other numbers, read-only rows: one process compiles them, and the next runs them. numba refuses swapped
    # bytes.
    assert run(tmp_path, "9") == ["TypingError"] * 4 + ["True"]
    assert run(tmp_path, "5") == ["False"]


def test_all_that_was_kept_is_linked_at_once_where_that_is_asked_for(tmp_path: Path) -> None:
    run(tmp_path, "1")
    asks = "from chainslam.slam.geometry.compiled import link_kernels; from its_kernels import *; link_kernels(); "
    assert run(tmp_path, "-c", asks + "print(len(described._made), len(depth._made))") == ["4", "0"]


def test_a_damaged_file_or_one_of_another_version_is_made_anew(tmp_path: Path) -> None:
    run(tmp_path, "1")
    (file,) = (tmp_path / "cache").rglob("described*.code")
    for damaged in (b"", file.read_bytes()[:-100], b"something else"):
        file.write_bytes(damaged)
        assert run(tmp_path, "1") == ["True"]
        assert run(tmp_path, "1") == ["False"]
    file.rename(file.with_name(file.name.replace(".code", "0.code")))
    assert run(tmp_path, "1") == ["True"]


def test_a_kernel_that_calls_itself_is_linked_to_itself(tmp_path: Path) -> None:
    assert [run(tmp_path, "0", "depth") for _ in range(2)] == [["False", "5", "True"], ["False", "5", "False"]]


def test_compiling_switched_off_runs_the_plain_loop(tmp_path: Path) -> None:
    run(tmp_path, "1")
    assert run(tmp_path, "2", NUMBA_DISABLE_JIT="1") == ["True"]


@given(
    st.sampled_from(["f8", "f4", "i8", "u1", "?"]).flatmap(lambda kind: arrays(kind, (3, 4), elements=st.just(1))),
    st.sampled_from([np.ascontiguousarray, np.asfortranarray, lambda rows: rows[:, ::2], lambda rows: rows[:2, 0]]),
    st.booleans(),
)
def test_kinds_tell_arrays_apart_as_numba_does(rows, arranged, writable):
    from numba import typeof

    known = np.zeros((3, 4)), np.zeros(5), np.zeros((1, 1), order="F")
    array = arranged(rows)
    array.flags.writeable = writable and array.flags.writeable
    for other in known:
        assert (kinds((array,)) == kinds((other,))) == (typeof(array) == typeof(other))


def test_lists_records_and_swapped_bytes_are_left_to_numba():
    assert decide((np.zeros(2), 1, 2.0, None, True, (np.zeros(1), np.int64(1))))
    for arg in ([1.0], "text", np.zeros(1, ">f8"), np.zeros(1, [("x", "f8")]), np.array([None]), (1, [2])):
        assert not decide((arg,))
