"""In what order linear algebra sums is decided before numpy is imported."""

import os
import subprocess
import sys
from pathlib import Path

import pytest

CORES = """
import sys, ctypes
from pathlib import Path
{first}
import numpy, scipy.linalg
loaded = {{line.split()[-1] for line in Path("/proc/self/maps").read_text().splitlines() if "openblas" in line}}
for each in loaded:
    for name in ("scipy_openblas_get_corename64_", "scipy_openblas_get_corename"):
        named = getattr(ctypes.CDLL(each), name, None)
        if named is not None:
            named.restype = ctypes.c_char_p
            print(named().decode())
"""


@pytest.mark.skipif(not sys.platform.startswith("linux"), reason="reads what Linux tells of processes")
@pytest.mark.parametrize(
    "first", ["import chainslam.experiments", "import studies.runner.rows", "import tests.arithmetic"]
)
def test_one_kernel_sums_on_every_processor_that_has_it(first):
    """A processor with wider registers would sum in an order of its own, and its drives would take other ways."""
    if " avx2 " not in Path("/proc/cpuinfo").read_text():
        pytest.skip("this processor lacks the kernel")
    env = {name: value for name, value in os.environ.items() if name != "OPENBLAS_CORETYPE"}
    words = [sys.executable, "-c", CORES.format(first=first)]
    root = Path(__file__).parents[2]
    told = subprocess.run(words, cwd=root, env=env, capture_output=True, text=True, check=True).stdout.split()
    if not told:
        pytest.skip("this numpy is built with another library")
    assert set(told) == {"Haswell"}
