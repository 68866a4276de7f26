import importlib.util
import subprocess
import sys
from pathlib import Path

import numpy as np

import chainslam.slam.geometry.compiled as compiled_module

CALLED = """
from chainslam.slam.geometry.compiled import compiled
{constant}
@compiled
def inner(x):
    return {inner}
"""
CALLER = '''
from inner_kernels import inner
from chainslam.slam.geometry.compiled import compiled
@compiled
def outer(xs):
    """Sums."""
    total = 0.0
    for x in xs:
        total += inner(x)
    return total
import sys
import numpy as np
before = "numba" in sys.modules
print(outer(np.arange(4.0)), outer.__doc__, before, "numba" in sys.modules)
'''


def run(folder: Path, inner: str, constant: str = "FACTOR = 2.0") -> str:
    folder.mkdir(exist_ok=True)
    (folder / "inner_kernels.py").write_text(CALLED.format(inner=inner, constant=constant))
    (folder / "outer_kernels.py").write_text(CALLER)
    root = Path(__file__).parents[3]
    environment = {
        "PYTHONPATH": f"{root}:{folder}",
        "NUMBA_CACHE_DIR": str(folder / "cache"),
        "PYTHONDONTWRITEBYTECODE": "1",
    }
    told = subprocess.run(
        [sys.executable, "outer_kernels.py"], cwd=folder, env=environment, capture_output=True, text=True, check=True
    )
    assert told.stderr.count("compiling") == len(told.stderr.splitlines()) <= 1
    return f"{told.stdout.strip()}{' compiled' * len(told.stderr.splitlines())}"


def test_a_kernel_is_kept_between_processes_and_one_that_changed_is_compiled_anew(tmp_path: Path) -> None:
    assert run(tmp_path, "x * FACTOR") == "12.0 Sums. False True compiled"
    assert run(tmp_path, "x * FACTOR") == "12.0 Sums. False False"
    # Another file than the one that calls it changes: numba by itself would run what it compiled before.
    assert run(tmp_path, "x + FACTOR") == "14.0 Sums. False True compiled"
    assert run(tmp_path, "x + FACTOR", "FACTOR = 3.0") == "18.0 Sums. False True compiled"


def test_a_home_that_cannot_be_written_does_not_stop_a_kernel(tmp_path: Path) -> None:
    (tmp_path / "cache").write_text("a file where the folder should be")
    assert run(tmp_path, "x * FACTOR").startswith("12.0")


def test_dividing_by_zero_is_infinite_as_in_numpy() -> None:
    from chainslam.slam.geometry.compiled import compiled

    @compiled
    def inverse(x: float) -> float:
        return 1.0 / x

    assert inverse(0.0) == np.inf


def test_another_installation_of_the_same_source_has_machine_code_of_its_own(tmp_path, monkeypatch):
    """numba keeps it by place: what one has compiled says nothing of the other."""
    found = []
    for place in ("one", "other", "one"):
        path = tmp_path / place / "twin_kernels.py"
        path.parent.mkdir(exist_ok=True)
        path.write_text(
            "from chainslam.slam.geometry.compiled import compiled\n\n\n@compiled\ndef same(x):\n    return x\n"
        )
        spec = importlib.util.spec_from_file_location("twin_kernels", path)
        module = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(module)
        monkeypatch.setattr(compiled_module, "_FINGERPRINTS", {})
        found.append(compiled_module._fingerprint(module.same.plain))
    assert found[0] == found[2] != found[1]
