"""Kernels are compiled once, anew when what they are made of has changed, and run as plain loops where that is asked.

Each process here has kernels of its own in a folder of its own: `outer` calls `inner` of another file.
"""

import os
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

CALLED = """
from enum import IntEnum
from typing import NamedTuple
from chainslam.slam.geometry.compiled import compiled
from constants import FACTOR, Kind
class Pair(NamedTuple):
    first: float
    second: float
@compiled
def inner(x, pair):
    return {inner}
"""
CALLER = '''
import sys
import numpy as np
from inner_kernels import Pair, inner
from chainslam.slam.geometry.compiled import compiled
@compiled
def outer(xs, pair):
    """Sums."""
    total = 0.0
    for x in xs:
        total += inner(x, pair)
    return Pair(total, pair.second)
assert "numba" not in sys.modules
sums = outer(np.arange(4.0), Pair(1.0, 10.0))
assert type(sums) is Pair
print(*sums, outer.__doc__, type(outer.machine).__name__)
'''
CONSTANTS = """
from enum import IntEnum
FACTOR = 2.0
Kind = IntEnum("Kind", "ONE TWO")
"""


def started(folder: Path, inner: str = "x * FACTOR", constants: str = CONSTANTS, **variables: str):
    folder.mkdir(exist_ok=True)
    files = {"constants.py": constants, "inner_kernels.py": CALLED.format(inner=inner), "outer_kernels.py": CALLER}
    for name, content in files.items():
        path = folder / name
        # What another process may be reading is not written again: it would find a file cut short.
        if not path.exists() or path.read_text() != content:
            path.write_text(content)
    around = {
        "PYTHONPATH": f"{Path(__file__).parents[3]}:{folder}",
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    words = [sys.executable, "outer_kernels.py"]
    pipe = subprocess.PIPE
    return subprocess.Popen(words, cwd=folder, env=os.environ | around | variables, stdout=pipe, stderr=pipe, text=True)


def ended(process) -> str:
    """Return what a process printed, and whether it said that it compiled: in one line, if at all."""
    out, told = process.communicate(timeout=300)
    assert process.returncode == 0, told
    assert told.count("compiling") == len(told.splitlines()) <= 1
    return f"{out.strip()}{' compiled' * len(told.splitlines())}"


def run(*args: object, **variables: str) -> str:
    return ended(started(*args, **variables))  # type: ignore[arg-type]


def test_a_kernel_is_kept_between_processes(tmp_path):
    assert run(tmp_path) == "12.0 10.0 Sums. CPUDispatcher compiled"
    assert run(tmp_path) == "12.0 10.0 Sums. CPUDispatcher"


@pytest.mark.parametrize(
    ("inner", "constants", "then"),
    [
        ("x + FACTOR", CONSTANTS, 14.0),
        ("x * FACTOR", CONSTANTS.replace("2.0", "3.0"), 18.0),
        ("x * FACTOR if Kind.TWO == 2 else x * 3.0", CONSTANTS.replace("TWO", "BEFORE TWO"), 18.0),
    ],
    ids=["a called kernel", "a number of another file", "an enumeration"],
)
def test_one_that_is_made_of_something_else_now_is_compiled_anew(inner, constants, then, tmp_path):
    """What changed stands in another file: numba by itself would run what it compiled before."""
    before = inner if constants != CONSTANTS else "x * FACTOR"
    assert run(tmp_path, before).startswith("12.0")
    assert run(tmp_path, inner, constants) == f"{then} 10.0 Sums. CPUDispatcher compiled"
    assert run(tmp_path, before) == "12.0 10.0 Sums. CPUDispatcher"


def test_processes_that_start_at_once_on_nothing_compiled_do_not_disturb_each_other(tmp_path):
    at_once = [started(tmp_path) for _ in range(4)]
    assert {ended(process) for process in at_once} <= {f"12.0 10.0 Sums. CPUDispatcher{e}" for e in ("", " compiled")}
    assert run(tmp_path) == "12.0 10.0 Sums. CPUDispatcher"


def test_a_home_that_cannot_be_written_does_not_stop_a_kernel(tmp_path):
    (tmp_path / "cache").write_text("a file where the folder should be")
    (tmp_path / "temporary").mkdir()
    assert run(tmp_path, TMPDIR=str(tmp_path / "temporary")) == "12.0 10.0 Sums. CPUDispatcher compiled"
    assert run(tmp_path, TMPDIR=str(tmp_path / "temporary")) == "12.0 10.0 Sums. CPUDispatcher"


def test_compiling_switched_off_runs_the_plain_loop(tmp_path):
    assert run(tmp_path, NUMBA_DISABLE_JIT="1") == "12.0 10.0 Sums. function"
    assert not list(tmp_path.rglob("*.nb?"))


def test_dividing_by_zero_is_infinite_as_in_numpy():
    from chainslam.slam.geometry.compiled import compiled

    @compiled
    def inverse(x: float) -> float:
        return 1.0 / x

    assert inverse(0.0) == np.inf


def test_other_functions_of_a_program_are_kept_where_numba_keeps_them(tmp_path, monkeypatch):
    from numba import config

    from chainslam.slam.geometry.matrix_kernels import wrapped

    monkeypatch.setattr(config, "CACHE_DIR", str(tmp_path))
    vars(wrapped).pop("machine", None)
    assert wrapped(0.5) == 0.5
    assert str(tmp_path) == config.CACHE_DIR
    assert not list(tmp_path.iterdir())
